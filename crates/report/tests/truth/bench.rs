//! A simulated rig whose specimen can be changed, to calibrate and to measure.

use std::sync::Arc;

use brdf::Brdf;
use capture::{Command, Header, MemoryJournal, Outcome, Record};
use firmware_sim::Bench;
use firmware_sim::in_process::InProcessRig;
use report::Standard;
use rig::{Certificate, Drive, Rig, RigFile};
use sweep::{Job, Plan};
use tokio::sync::watch;

/// Lines of a `[sim]` table: servos that stand where they are told and follow at once, with hardly any play. For what light,
/// photometer and standards do; what is stated on servos as they are, `servos` tries.
pub(crate) const FINE_SERVOS: &str = "light_backlash_deg = 0.02\nsensor_backlash_deg = 0.02\n\
     following_lag_ms = 8\nstatic_error_counts = 0\njitter_counts = 0\n";

/// A rig with what was found out about it.
pub(crate) struct Laboratory {
    pub(crate) text: String,
    pub(crate) file: RigFile,
    pub(crate) certificate: Certificate,
}

impl Laboratory {
    /// A rig of these lines, not calibrated.
    pub(crate) fn new(text: &str) -> Self {
        Self {
            file: RigFile::parse(text, "test.toml".as_ref()).expect("a good rig file"),
            text: text.to_owned(),
            certificate: Certificate::default(),
        }
    }

    /// Puts a standard on the stage and takes what it says into the certificate.
    pub(crate) async fn calibrate(&mut self, standard: &Standard, specimen: Arc<dyn Brdf>) {
        let records = self.visit(standard, specimen).await;
        let certified = standard.certify(&self.file, &records, &self.certificate);
        self.certificate = certified.expect("a good standard");
    }

    /// The records of a calibration.
    pub(crate) async fn visit(&self, standard: &Standard, specimen: Arc<dyn Brdf>) -> Vec<Record> {
        let visits = standard.visits(&self.file);
        self.run(specimen, "", |mechanics| {
            sweep::visits("calibration", &visits, mechanics)
        })
        .await
    }

    /// Trap, mirror and white reference, in this order.
    pub(crate) async fn calibrate_all(&mut self, white: &report::WhiteReference, on_stage: Arc<dyn Brdf>) {
        for standard in [Standard::Mirror, Standard::Trap] {
            let specimen = brdf::specimen(&standard.simulated().expect("known")).expect("known");
            self.calibrate(&standard, specimen).await;
        }
        self.calibrate(&Standard::White(white.clone()), on_stage).await;
    }

    /// The records of a job on a specimen.
    pub(crate) async fn measure(&self, specimen: Arc<dyn Brdf>, job: &str) -> Vec<Record> {
        let parsed = Job::parse(job, "job.toml").expect("a good job");
        self.run(specimen, job, |mechanics| sweep::plan(&parsed, mechanics))
            .await
    }

    /// How a job on a specimen ends, and its records, complete or not.
    pub(crate) async fn attempt(&self, specimen: Arc<dyn Brdf>, job: &str) -> (Outcome, Vec<Record>) {
        let parsed = Job::parse(job, "job.toml").expect("a good job");
        self.execute(specimen, job, |mechanics| sweep::plan(&parsed, mechanics))
            .await
    }

    async fn run(
        &self,
        specimen: Arc<dyn Brdf>,
        job: &str,
        plan: impl FnOnce(&sweep::Mechanics) -> Result<Plan, sweep::SweepError>,
    ) -> Vec<Record> {
        let (outcome, records) = self.execute(specimen, job, plan).await;
        assert_eq!(outcome, Outcome::Done);
        records
    }

    async fn execute(
        &self,
        specimen: Arc<dyn Brdf>,
        job: &str,
        plan: impl FnOnce(&sweep::Mechanics) -> Result<Plan, sweep::SweepError>,
    ) -> (Outcome, Vec<Record>) {
        let bench = Bench::with_specimen(&self.file, specimen).expect("a good [sim] table");
        let mut rig = InProcessRig::over(bench, &self.file);
        let start = rig.snapshot().await.expect("all devices answer").pose();
        let plan = plan(&capture::mechanics(&self.file, Some(start))).expect("possible on this rig");
        let mut journal = MemoryJournal(vec![Record::Header(Header {
            run: "test".to_owned(),
            version: "0".to_owned(),
            job: job.to_owned(),
            rig: self.text.clone(),
            plan,
            started: String::new(),
            certificate: Some(Box::new(self.certificate.clone())),
        })]);
        let (_operator, control) = watch::channel(Command::Run);
        let mut drive = Drive::new(rig, self.file.clone());
        let outcome = capture::run(&mut drive, &mut journal, control, &mut |_| ()).await;
        (outcome.expect("the journal is sound"), journal.0)
    }
}
