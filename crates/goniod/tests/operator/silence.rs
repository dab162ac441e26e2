use std::time::Duration;

use firmware_sim::{Disturbance, Fault};
use goniod::Caller;
use rig::Device;
use rig::dynamixel::register::servo;

use crate::world::World;

/// A device that gives no reply is asked for half a second and more before it counts as silent. Whoever presses a stop
/// meanwhile does not wait for that.
#[tokio::test(start_paused = true)]
async fn an_idle_rig_on_a_silent_bus_hears_a_stop_at_once() {
    for emergency in [false, true] {
        let mut world = World::new();
        let (daemon, bench) = world.open().await;
        let by = Caller {
            name: "operator".to_owned(),
        };
        bench.schedule(Fault {
            device: Device::Sensor,
            at: Duration::ZERO,
            what: Disturbance::Silence(Duration::from_secs(3600)),
        });
        // The daemon looks at the rig every second: now it is in the middle of asking.
        tokio::time::sleep(Duration::from_millis(1200)).await;
        let before = bench.write_count();
        let pressed = bench.now();
        match emergency {
            true => drop(daemon.estop(&by).await.unwrap()),
            false => daemon.stop(&by).await.unwrap(),
        }
        while bench.write_count() == before {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        let writes = bench.writes();
        let halted = writes[before..]
            .iter()
            .find(|write| write.device == Device::Light && write.value(servo::GOAL_POSITION).is_some());
        let first = halted.unwrap_or(&writes[before]);
        let after = first.at.saturating_sub(pressed);
        assert!(
            after < Duration::from_millis(100),
            "emergency {emergency}: heard after {after:?}"
        );
    }
}
