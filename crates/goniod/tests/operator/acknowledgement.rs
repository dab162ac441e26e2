use std::time::Duration;

use goniod::{Behaviour, Caller, FaultId};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::world::World;

const PAIRS: usize = 1000;
/// The two requests of a pair come this close together at most.
const APART_US: u64 = 20_000;

/// An operator acknowledges the emergency stop that was looked at while another one presses it anew.
async fn pairs(store: Behaviour, seed: u64) {
    let mut world = World::new();
    let (daemon, _) = world.open().await;
    world.store().behave(store);
    let by = Caller {
        name: "operator".to_owned(),
    };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for pair in 0..PAIRS {
        let looked_at = daemon.estop(&by).await.unwrap();
        let apart = Duration::from_micros(random.random_range(0..APART_US));
        let acknowledge = async {
            if random.random_bool(0.5) {
                tokio::time::sleep(apart).await;
            }
            daemon.acknowledge(&by, &looked_at).await
        };
        let again = async {
            tokio::time::sleep(apart / 2).await;
            daemon.estop(&by).await.unwrap()
        };
        let (acknowledged, pressed) = tokio::join!(acknowledge, again);
        let latched: Option<FaultId> = daemon.rig().borrow().fault.as_ref().map(|fault| fault.id.clone());
        assert_eq!(
            latched.as_ref(),
            Some(&pressed),
            "seed {seed}, pair {pair}: the second press is lost"
        );
        if let Err(refusal) = acknowledged {
            assert_eq!(
                refusal.newer.map(|fault| fault.id),
                Some(pressed),
                "seed {seed}, pair {pair}"
            );
        }
    }
    // A program that is started again shows the last one still.
    let last = daemon.rig().borrow().fault.clone();
    world.store().behave(Behaviour::Prompt);
    daemon.shutdown().await;
    let (daemon, _) = world.open().await;
    assert_eq!(daemon.rig().borrow().fault, last);
    daemon.shutdown().await;
}

#[tokio::test(start_paused = true)]
async fn no_emergency_stop_is_lost_beside_an_acknowledgement() {
    pairs(Behaviour::Prompt, 1).await;
}

#[tokio::test(start_paused = true)]
async fn no_emergency_stop_is_lost_beside_an_acknowledgement_while_the_store_is_locked() {
    pairs(Behaviour::Paused, 2).await;
}

#[tokio::test(start_paused = true)]
async fn no_emergency_stop_is_lost_beside_an_acknowledgement_while_the_store_fails() {
    pairs(Behaviour::Failing, 3).await;
}
