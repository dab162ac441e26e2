use super::*;
use crate::dynamixel::register::{common, servo};

#[test]
fn every_model_has_a_name_and_a_number_of_its_own() {
    for (i, model) in MODELS.iter().enumerate() {
        assert_eq!(Model::named(model.name), Some(model));
        assert_eq!(Model::numbered(model.number), Some(model), "{}", model.name);
        assert!(
            MODELS[..i].iter().all(|other| other.name != model.name),
            "{} is there twice",
            model.name
        );
    }
}

#[test]
fn the_bus_is_no_part_of_a_model() {
    for model in MODELS {
        for bus in model.series.buses {
            assert_eq!(Model::named(&format!("{}{bus}", model.name)), Some(model));
        }
        assert_eq!(Model::named(&format!("{}-X", model.name)), None);
    }
    assert_eq!(Model::named("XM430"), None);
    assert_eq!(Model::named(""), None);
}

/// A row that was typed wrongly would be caught here: what the manual says of every servo.
#[test]
fn the_figures_of_every_model_agree_with_each_other() {
    for model in MODELS {
        let name = model.name;
        let series = model.series;
        let [low, high] = model.position_limits;
        assert!(
            model.positions().contains(&low) && model.positions().contains(&high),
            "{name}"
        );
        assert!(
            model.velocity_limit > 0 && model.velocity_limit <= model.velocity_max,
            "{name}"
        );
        assert!(
            model
                .acceleration_limit
                .is_none_or(|limit| limit <= model.acceleration_max),
            "{name}"
        );
        assert!(model.voltage_v().contains(&model.supply_v), "{name}");
        assert!(model.voltage_least <= model.voltage_limits[0], "{name}");
        assert!(model.modes.contains(&3), "{name} has position mode");
        assert_eq!(
            model.modes.contains(&5),
            model.current_limit.is_some() && !series.centred,
            "{name}"
        );
        assert!(model.gains.iter().all(|&gain| gain <= series.gain_max), "{name}");
        assert!(series.firmware >= series.firmware_min, "{name}");
        for area in series.indirect {
            let [first, last] = series.indirect_targets;
            assert!(
                (first..=last).contains(&area.data),
                "{name}: an unmapped cell shows itself"
            );
            assert!((first..=last).contains(&(area.data + area.cells - 1)), "{name}");
        }
    }
}

#[test]
fn a_place_leads_back_to_the_register_that_it_is_of() {
    for model in MODELS {
        for address in 0..168 {
            assert_eq!(
                model.series.named_by(model.series.place(address)),
                address,
                "{}",
                model.name
            );
        }
    }
    assert_eq!(
        Model::named("XM430-W350")
            .unwrap()
            .at(servo::GOAL_POSITION)
            .address,
        116
    );
    assert_eq!(Model::named("XM430-W350").unwrap().at(common::ID), common::ID);
}

/// Model numbers of ROBOTIS' `dynamixel.model`, typed from there.
#[test]
fn numbers_are_those_of_robotis() {
    let numbers = [
        (30, "MX-28"),
        (311, "MX-64"),
        (321, "MX-106"),
        (1000, "XH430-W350"),
        (1001, "XD430-T350"),
        (1010, "XH430-W210"),
        (1011, "XD430-T210"),
        (1020, "XM430-W350"),
        (1030, "XM430-W210"),
        (1040, "XH430-V350"),
        (1050, "XH430-V210"),
        (1060, "XL430-W250"),
        (1070, "XC430-W150"),
        (1080, "XC430-W240"),
        (1090, "2XL430-W250"),
        (1100, "XH540-W270"),
        (1101, "XD540-T270"),
        (1110, "XH540-W150"),
        (1111, "XD540-T150"),
        (1120, "XM540-W270"),
        (1130, "XM540-W150"),
        (1140, "XH540-V270"),
        (1150, "XH540-V150"),
        (1160, "2XC430-W250"),
        (1170, "XW540-T260"),
        (1180, "XW540-T140"),
        (1190, "XL330-M077"),
        (1200, "XL330-M288"),
        (1210, "XC330-T181"),
        (1220, "XC330-T288"),
        (1230, "XC330-M181"),
        (1240, "XC330-M288"),
        (1270, "XW430-T333"),
        (1310, "XW540-H260"),
        (2000, "PH42-020-S300"),
        (2010, "PH54-100-S500"),
        (2020, "PH54-200-S500"),
        (2100, "PM42-010-S260"),
        (2110, "PM54-040-S250"),
        (2120, "PM54-060-S250"),
    ];
    for (number, name) in numbers {
        assert_eq!(
            Model::numbered(number).map(|model| model.name),
            Some(name),
            "{number}"
        );
    }
}

/// Addresses of ROBOTIS' `ph54_200_s500.model`, typed from there.
#[test]
fn the_p_series_has_its_registers_where_robotis_says() {
    let p = Model::named("PH54-200-S500-R").unwrap();
    let addresses = [
        (common::STATUS_RETURN_LEVEL, 516),
        (common::HARDWARE_ERROR_STATUS, 518),
        (common::BUS_WATCHDOG, 546),
        (common::RETURN_DELAY_TIME, 9),
        (servo::ACCELERATION_LIMIT, 40),
        (servo::VELOCITY_LIMIT, 44),
        (servo::SHUTDOWN, 63),
        (servo::TORQUE_ENABLE, 512),
        (servo::PROFILE_ACCELERATION, 556),
        (servo::PROFILE_VELOCITY, 560),
        (servo::GOAL_POSITION, 564),
        (servo::MOVING, 570),
        (servo::MOVING_STATUS, 571),
        (servo::PRESENT_VELOCITY, 576),
        (servo::PRESENT_POSITION, 580),
        (servo::PRESENT_INPUT_VOLTAGE, 592),
        (servo::PRESENT_TEMPERATURE, 594),
    ];
    for (register, address) in addresses {
        assert_eq!(p.at(register).address, address, "{}", register.name);
    }
    assert_eq!(p.positions(), -501_923..=501_923);
    assert_eq!(p.homing_offset_max(), 250_961, "90°");
}

/// The indirect data of an XL330 moved with firmware 52 (`xl330_m288.model`, `xl330_m288_fw52.model`).
#[test]
fn old_firmware_has_no_indirect_data_at_a_known_place() {
    let xl330 = Model::named("XL330-M288-T").unwrap().series;
    assert_eq!(xl330.indirect(51), None);
    assert_eq!(xl330.indirect(52).map(|area| area.data), Some(208));
    let xm430 = Model::named("XM430-W350").unwrap().series;
    assert_eq!(xm430.indirect(38).map(|area| area.data), Some(224));
}
