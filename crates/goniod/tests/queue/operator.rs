use arms::{Arm, ArmAngle};
use goniod::{Action, Activity, FaultCode, JobState, RefusalKind, What};

use crate::bench::{
    Bench, SHORT, acknowledge, idle, on_stage, operator, readings, rig, state, submission, until,
};

/// Real time, so that there is time to press something.
const REAL: &str = "sim.clock = \"real\"\n";

#[tokio::test]
async fn a_stop_ends_at_once_and_the_run_goes_on_where_it_was() {
    let bench = Bench::new(REAL);
    let daemon = bench.open().await;
    let by = operator();
    // Pressed between two jobs it holds the next one, until an operator starts it.
    daemon.stop(&by).await.unwrap();
    let mut events = daemon.events(None);
    let job = daemon.submit(&by, submission(&on_stage())).await.unwrap();
    state(&mut events, job.id, JobState::AwaitingSpecimen).await;
    assert!(daemon.rig().borrow().queue_held.is_some());
    daemon.act(&by, job.id, Action::Ready).await.unwrap();
    assert_eq!(daemon.rig().borrow().queue_held, None);
    rig(&daemon, |rig| rig.arms[0].moving).await;
    daemon.stop(&by).await.unwrap();
    let stopped = state(&mut events, job.id, JobState::Interrupted).await;
    assert!(stopped.why.unwrap().contains("stopped"));
    let view = idle(&daemon).await;
    assert!(!view.lamp && view.fault.is_none(), "{view:?}");
    assert!(view.arms.iter().all(|arm| arm.torque), "the arms hold");
    daemon.act(&by, job.id, Action::Resume).await.unwrap();
    readings(&mut events, 3).await;
    daemon.stop(&by).await.unwrap();
    state(&mut events, job.id, JobState::Interrupted).await;
    daemon.act(&by, job.id, Action::Cancel).await.unwrap();
    daemon.shutdown().await;
}

#[tokio::test]
async fn a_pause_holds_until_it_is_told_to_go_on() {
    let bench = Bench::new(REAL);
    let daemon = bench.open().await;
    let by = operator();
    let mut events = daemon.events(None);
    let job = daemon.submit(&by, submission(&on_stage())).await.unwrap();
    readings(&mut events, 1).await;
    assert_eq!(daemon.proceed(&by).await.unwrap_err().kind, RefusalKind::Conflict);
    daemon.pause(&by).await.unwrap();
    state(&mut events, job.id, JobState::Paused).await;
    assert_eq!(daemon.rig().borrow().activity, Activity::Paused);
    let refusal = daemon
        .jog(&by, Arm::Light, ArmAngle::from_deg(0.0))
        .await
        .unwrap_err();
    assert_eq!(refusal.kind, RefusalKind::Conflict, "{refusal}");
    daemon.proceed(&by).await.unwrap();
    state(&mut events, job.id, JobState::Running).await;
    readings(&mut events, 1).await;
    daemon.pause(&by).await.unwrap();
    state(&mut events, job.id, JobState::Paused).await;
    daemon.stop(&by).await.unwrap();
    state(&mut events, job.id, JobState::Interrupted).await;
    daemon.shutdown().await;
}

#[tokio::test]
async fn an_emergency_stop_is_latched_until_acknowledged_also_by_a_restart() {
    let bench = Bench::new(REAL);
    let daemon = bench.open().await;
    let by = operator();
    let mut events = daemon.events(None);
    let job = daemon.submit(&by, submission(&on_stage())).await.unwrap();
    rig(&daemon, |rig| rig.arms[0].moving).await;
    daemon.estop(&by).await.unwrap();
    state(&mut events, job.id, JobState::Interrupted).await;
    let view = idle(&daemon).await;
    assert_eq!(view.fault.unwrap().code, FaultCode::Estop);
    assert!(!view.lamp);
    daemon.shutdown().await;

    // The rest in simulated time.
    let bench = Bench {
        rig: String::new(),
        ..bench
    };
    let daemon = bench.open().await;
    let fault = daemon.rig().borrow().fault.clone().expect("still latched");
    assert_eq!(fault.code, FaultCode::Estop);
    for refusal in [
        daemon.act(&by, job.id, Action::Resume).await.map(|_| ()),
        daemon.park(&by).await,
        daemon.jog(&by, Arm::Light, ArmAngle::from_deg(-40.0)).await,
    ] {
        let refusal = refusal.unwrap_err();
        assert!(refusal.why.contains("acknowledge"), "{refusal}");
    }
    let mut events = daemon.events(None);
    acknowledge(&daemon).await;
    until(&mut events, |event| {
        matches!(event.what, What::Acknowledged { .. }).then_some(())
    })
    .await;
    assert_eq!(
        daemon.acknowledge(&by, &fault.id).await.unwrap_err().kind,
        RefusalKind::Conflict
    );
    let still = daemon.job(job.id).await.unwrap();
    assert_eq!(still.state, JobState::Interrupted, "nothing starts by itself");
    daemon.act(&by, job.id, Action::Resume).await.unwrap();
    state(&mut events, job.id, JobState::Done).await;
    daemon.shutdown().await;
}

#[tokio::test]
async fn an_emergency_stop_of_an_idle_rig_is_latched_too() {
    let bench = Bench::new("");
    let daemon = bench.open().await;
    let by = operator();
    rig(&daemon, |rig| rig.connected).await;
    daemon.estop(&by).await.unwrap();
    rig(&daemon, |rig| rig.fault.is_some()).await;
    let mut events = daemon.events(None);
    let job = daemon.submit(&by, submission(&on_stage())).await.unwrap();
    state(&mut events, job.id, JobState::AwaitingSpecimen).await;
    let refusal = daemon.act(&by, job.id, Action::Ready).await.unwrap_err();
    assert_eq!(refusal.kind, RefusalKind::Conflict, "{refusal}");
    acknowledge(&daemon).await;
    daemon.act(&by, job.id, Action::Ready).await.unwrap();
    state(&mut events, job.id, JobState::Done).await;
    daemon.shutdown().await;
}

#[tokio::test]
async fn arms_are_moved_by_hand_within_the_envelope_alone() {
    let bench = Bench::new("");
    let daemon = bench.open().await;
    let by = operator();
    for (arm, deg) in [(Arm::Light, 89.0), (Arm::Light, 60.0), (Arm::Sensor, f64::NAN)] {
        let refusal = daemon.jog(&by, arm, ArmAngle::from_deg(deg)).await.unwrap_err();
        assert_eq!(refusal.kind, RefusalKind::Invalid, "{arm} to {deg}°: {refusal}");
    }
    daemon
        .jog(&by, Arm::Light, ArmAngle::from_deg(-10.0))
        .await
        .unwrap();
    let there = |rig: &goniod::RigView| {
        rig.activity == Activity::Idle
            && rig.arms[0]
                .measured_deg
                .is_some_and(|deg| (deg + 10.0).abs() < 0.2)
    };
    let view = rig(&daemon, there).await;
    assert!(
        (view.arms[1].measured_deg.unwrap() - 45.0).abs() < 0.2,
        "the other stays"
    );
    // The hand may not have said yet that it is done.
    while let Err(refusal) = daemon.park(&by).await {
        assert_eq!(refusal.kind, RefusalKind::Conflict, "{refusal}");
        tokio::task::yield_now().await;
    }
    rig(&daemon, |rig| {
        rig.activity == Activity::Idle
            && rig.arms[0]
                .measured_deg
                .is_some_and(|deg| (deg + 45.0).abs() < 0.2)
    })
    .await;
    daemon.shutdown().await;
}

#[tokio::test]
async fn after_a_restart_nothing_starts_by_itself() {
    let bench = Bench::new(REAL);
    let daemon = bench.open().await;
    let by = operator();
    let mut events = daemon.events(None);
    let first = daemon.submit(&by, submission(&on_stage())).await.unwrap();
    let second = daemon.submit(&by, submission(&on_stage())).await.unwrap();
    readings(&mut events, 1).await;
    daemon.shutdown().await;
    let bench = Bench {
        rig: String::new(),
        ..bench
    };
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    // Whoever waits for its turn now is asked about, although its file says that nobody need be.
    let third = daemon.submit(&by, submission(SHORT)).await.unwrap();
    assert_eq!(daemon.job(first.id).await.unwrap().state, JobState::Interrupted);
    assert_eq!(
        daemon.job(second.id).await.unwrap().state,
        JobState::AwaitingSpecimen
    );
    daemon.act(&by, first.id, Action::Resume).await.unwrap();
    state(&mut events, first.id, JobState::Done).await;
    daemon.act(&by, second.id, Action::Ready).await.unwrap();
    state(&mut events, second.id, JobState::Done).await;
    state(&mut events, third.id, JobState::AwaitingSpecimen).await;
    daemon.shutdown().await;
}

#[tokio::test]
async fn an_acknowledgement_ends_the_fault_that_it_names_and_no_newer_one() {
    let bench = Bench::new("");
    let daemon = bench.open().await;
    let by = operator();
    rig(&daemon, |rig| rig.connected).await;
    let first = daemon.estop(&by).await.unwrap();
    let second = daemon.estop(&by).await.unwrap();
    assert_ne!(first, second, "each press is a fault of its own");
    let refusal = daemon.acknowledge(&by, &first).await.unwrap_err();
    assert_eq!(refusal.kind, RefusalKind::Conflict);
    assert_eq!(
        refusal.newer.map(|fault| fault.id),
        Some(second.clone()),
        "the newer one is told"
    );
    assert!(daemon.rig().borrow().fault.is_some(), "it is latched still");
    daemon.acknowledge(&by, &second).await.unwrap();
    assert!(daemon.rig().borrow().fault.is_none());
    daemon.shutdown().await;
}

#[tokio::test]
async fn acknowledging_a_stalled_jog_starts_no_job_that_waits() {
    let bench =
        Bench::new("[sim]\nfault = [{ device = \"light\", at_s = 0.0, what = { stall_s = 600.0 } }]\n");
    let daemon = bench.open().await;
    let by = operator();
    daemon
        .jog(&by, Arm::Light, ArmAngle::from_deg(-10.0))
        .await
        .unwrap();
    let job = daemon.submit(&by, submission(&on_stage())).await.unwrap();
    rig(&daemon, |rig| {
        rig.fault.is_some() && rig.activity == Activity::Idle
    })
    .await;
    while let Err(refusal) = {
        let fault = daemon.rig().borrow().fault.clone().expect("it is latched");
        daemon.acknowledge(&by, &fault.id).await
    } {
        assert_eq!(refusal.kind, RefusalKind::Conflict, "{refusal}");
        tokio::task::yield_now().await;
    }
    // Whatever the queue does, it has done once it answers.
    let other = daemon.submit(&by, submission(SHORT)).await.unwrap();
    daemon.act(&by, other.id, Action::Cancel).await.unwrap();
    assert_eq!(
        daemon.job(job.id).await.unwrap().state,
        JobState::AwaitingSpecimen
    );
    daemon.shutdown().await;
}

#[tokio::test]
async fn a_stop_holds_the_queue_after_a_restart_too() {
    let bench = Bench::new("");
    let daemon = bench.open().await;
    daemon.stop(&operator()).await.unwrap();
    daemon.shutdown().await;
    let daemon = bench.open().await;
    let job = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    let mut events = daemon.events(Some(0));
    state(&mut events, job.id, JobState::AwaitingSpecimen).await;
    // Moving an arm by hand moves that arm, and ends no hold.
    daemon
        .jog(&operator(), Arm::Light, ArmAngle::from_deg(-10.0))
        .await
        .unwrap();
    rig(&daemon, |rig| {
        rig.activity == Activity::Idle && !rig.arms[0].moving
    })
    .await;
    assert!(daemon.rig().borrow().queue_held.is_some());
    daemon.shutdown().await;
}
