use crate::dynamixel::register::Register;

/// First address of the RAM area of the X series, by which the registers are named everywhere.
const RAM: u16 = 64;

/// First address behind what moves with the RAM area: the indirect addresses, which each series has where it has them.
const RAM_END: u16 = 168;

/// A control table that models share: where its registers are, and what their numbers mean.
#[derive(Debug, PartialEq)]
pub struct Series {
    /// Its name.
    pub name: &'static str,
    /// What a model's name may end with: the bus that it is wired for.
    pub buses: &'static [&'static str],
    /// First address of the RAM area, which begins with Torque Enable. Between there and the last External Port Data every
    /// series has the order of the X series.
    pub ram: u16,
    /// Unit of the velocity registers, rev/min.
    pub velocity_unit_rpm: f64,
    /// Unit of the acceleration registers, rev/min².
    pub acceleration_unit_rpm2: f64,
    /// Play of the gear, degrees of the servo, as the specifications of the e-manual say; of a series for which they say
    /// nothing that of the X series.
    pub backlash_deg: f64,
    /// Whether position 0 is in the middle of the single turn of position mode, rather than at its lower end.
    pub centred: bool,
    /// Largest position beyond a turn, counts.
    pub multi_turn: i32,
    /// Largest value of Profile Velocity.
    pub profile_velocity_max: u32,
    /// Whether a profile that is faster than the velocity limit is refused, rather than cut.
    pub profile_within_limit: bool,
    /// Moving Threshold, initial value and maximum.
    pub moving_threshold: [u32; 2],
    /// PWM Limit, initial value and maximum.
    pub pwm_limit: u16,
    /// Largest gain.
    pub gain_max: u16,
    /// Areas of indirect addressing; the first one is used.
    pub indirect: &'static [Indirect],
    /// First firmware that has the indirect data at this address.
    pub indirect_from_firmware: u8,
    /// First and last address that an indirect address may hold.
    pub indirect_targets: [u16; 2],
    /// Whether the indirect addresses are in the EEPROM: kept over a restart, and locked while the torque is on.
    pub indirect_in_eeprom: bool,
    /// Whether it has the register Startup Configuration.
    pub startup: bool,
    /// Address of Backup Ready; none where it has no backup of its control table.
    pub backup_ready: Option<u16>,
    /// Largest value of the Baud Rate register.
    pub baud_code_max: u8,
    /// First firmware with the bus watchdog and the drive mode as they are used here.
    pub firmware_min: u8,
    /// Firmware that simulated servos claim.
    pub firmware: u8,
}

/// An area of indirect addressing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Indirect {
    /// First address register, of 2 bytes each.
    pub addresses: u16,
    /// First data cell, of 1 byte each.
    pub data: u16,
    /// How many of both.
    pub cells: u16,
}

impl Series {
    /// Where this series has what the X series has at an address.
    pub const fn place(&self, address: u16) -> u16 {
        match RAM <= address && address < RAM_END {
            true => address - RAM + self.ram,
            false => address,
        }
    }

    /// Where the X series has what this series has at an address.
    pub const fn named_by(&self, address: u16) -> u16 {
        match self.ram <= address && address < RAM_END - RAM + self.ram {
            true => address - self.ram + RAM,
            false => address,
        }
    }

    /// Where this series has a register of the X series.
    pub const fn at(&self, register: Register) -> Register {
        Register {
            address: self.place(register.address),
            ..register
        }
    }

    /// The area of indirect addressing that a servo of this firmware has at a known place.
    pub fn indirect(&self, firmware: u8) -> Option<Indirect> {
        let known = firmware >= self.indirect_from_firmware;
        self.indirect.first().copied().filter(|_| known)
    }
}

/// XM, XH, XD, XW and the 430s without current registers (e-manual, XM430-W350). Bus Watchdog and Drive Mode came with
/// firmware 38, Startup Configuration and the backup with firmware 45.
const X_TABLE: Series = Series {
    name: "X",
    buses: &["-T", "-R"],
    ram: RAM,
    velocity_unit_rpm: 0.229,
    acceleration_unit_rpm2: 214.577,
    backlash_deg: 15.0 / 60.0,
    centred: false,
    multi_turn: 1_048_575,
    profile_velocity_max: 32_767,
    profile_within_limit: false,
    moving_threshold: [10, 1023],
    pwm_limit: 885,
    gain_max: 16_383,
    indirect: &[
        Indirect {
            addresses: 168,
            data: 224,
            cells: 28,
        },
        Indirect {
            addresses: 578,
            data: 634,
            cells: 28,
        },
    ],
    indirect_from_firmware: 0,
    indirect_targets: [64, 661],
    indirect_in_eeprom: false,
    startup: true,
    backup_ready: Some(147),
    baud_code_max: 7,
    firmware_min: 38,
    firmware: 46,
};

/// As it is.
pub(super) static X: Series = X_TABLE;

/// MX-28, MX-64 and MX-106 with Protocol 2.0: the table of the X
/// series with Acceleration Limit, and without Startup Configuration and backup.
pub(super) static MX: Series = Series {
    name: "MX (2.0)",
    buses: &["-T", "-R", "T", "R", "AT", "AR"],
    backlash_deg: 20.0 / 60.0,
    startup: false,
    backup_ready: None,
    firmware: 43,
    ..X_TABLE
};

/// XL330 and XC330: 20 indirect cells, whose data are at 208 from firmware 52 on and elsewhere before (`xl330_m288.model`,
/// `xl330_m288_fw52.model`); no baud rate beyond 4 M.
pub(super) static X330: Series = Series {
    name: "X330",
    buses: &["-T"],
    indirect: &[Indirect {
        addresses: 168,
        data: 208,
        cells: 20,
    }],
    indirect_from_firmware: 52,
    indirect_targets: [64, 227],
    baud_code_max: 6,
    firmware: 52,
    ..X_TABLE
};

/// PH and PM: the RAM area of the X series at 512, 128 indirect cells with their addresses in the EEPROM, positions from the
/// middle of the turn, other units. Their firmwares are numbered anew, and all have watchdog and drive mode.
pub(super) static P: Series = Series {
    name: "P",
    buses: &["-R"],
    ram: 512,
    velocity_unit_rpm: 0.01,
    acceleration_unit_rpm2: 1.0,
    backlash_deg: 6.0 / 60.0,
    centred: true,
    multi_turn: i32::MAX,
    profile_velocity_max: 2920,
    profile_within_limit: true,
    moving_threshold: [20, 2920],
    pwm_limit: 2009,
    gain_max: 32_767,
    indirect: &[Indirect {
        addresses: 168,
        data: 634,
        cells: 128,
    }],
    indirect_targets: [512, 1023],
    indirect_in_eeprom: true,
    backup_ready: Some(878),
    firmware_min: 1,
    firmware: 12,
    ..X_TABLE
};
