use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use async_trait::async_trait;
use capture::Record;
use tokio::sync::watch;

use super::{Store, StoreError};
use crate::{FaultView, Job, JobId, RunQuery, RunView, VerdictView};

/// A store that is gone with the program. It can be paused, slowed down, and made to fail, at every call.
///
/// It stands for a medium that does any of that, and for a daemon that is to leave nothing behind.
#[derive(Debug, Default)]
pub struct Memory {
    kept: Mutex<Kept>,
    behaviour: watch::Sender<Behaviour>,
}

/// How a [`Memory`] answers from now on, calls that wait already included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Behaviour {
    /// At once.
    #[default]
    Prompt,
    /// After so long, by tokio's clock.
    Slow(std::time::Duration),
    /// Not before it behaves otherwise.
    Paused,
    /// With an error.
    Failing,
}

#[derive(Debug, Default)]
struct Kept {
    lives: u64,
    jobs: BTreeMap<u64, Job>,
    runs: Vec<RunView>,
    records: BTreeMap<String, Vec<Record>>,
    audit: Vec<[String; 4]>,
}

impl Memory {
    /// An empty store.
    pub fn new() -> Self {
        Self::default()
    }

    /// Changes how it answers.
    pub fn behave(&self, behaviour: Behaviour) {
        self.behaviour.send_replace(behaviour);
    }

    /// Who asked what, and what came of it, oldest first: time, who, what, outcome.
    pub fn audited(&self) -> Vec<[String; 4]> {
        self.kept().audit.clone()
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Does something with what is kept, when and if the medium lets it.
    async fn call<T>(
        &self,
        what: &'static str,
        call: impl FnOnce(&mut Kept) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let mut behaviour = self.behaviour.subscribe();
        // Also a prompt medium is something that others may run before.
        tokio::task::yield_now().await;
        loop {
            let now = *behaviour.borrow_and_update();
            match now {
                Behaviour::Prompt => return call(&mut self.kept()),
                Behaviour::Failing => return Err(StoreError::Unavailable { what }),
                Behaviour::Slow(time) => {
                    tokio::select! {
                        () = tokio::time::sleep(time) => return call(&mut self.kept()),
                        _ = behaviour.changed() => {}
                    }
                }
                Behaviour::Paused => {
                    // An error is impossible: the sender is borrowed.
                    let _ = behaviour.changed().await;
                }
            }
        }
    }
}

impl Kept {
    fn run(&self, id: &str) -> Option<RunView> {
        let mut run = self.runs.iter().find(|run| run.id == id)?.clone();
        let records = self.records.get(id).map_or(&[][..], Vec::as_slice);
        let accepted = |record: &&Record| matches!(record, Record::Reading(reading) if reading.accepted);
        run.accepted = records.iter().filter(accepted).count() as u64;
        if let Some(job) = self.jobs.values().find(|job| job.id == run.job) {
            run.state = job.state;
        }
        Some(run)
    }

    fn taken(what: &'static str) -> StoreError {
        StoreError::Damaged {
            what,
            why: "its place is taken".to_owned(),
        }
    }
}

#[async_trait]
impl Store for Memory {
    async fn begin_life(&self, _at: &str) -> Result<u64, StoreError> {
        self.call("count a start", |kept| {
            kept.lives += 1;
            Ok(kept.lives)
        })
        .await
    }

    async fn add_job(&self, job: &mut Job) -> Result<(), StoreError> {
        self.call("queue a job", |kept| {
            job.place = kept.jobs.last_key_value().map_or(1, |(place, _)| place + 1);
            kept.jobs.insert(job.place, job.clone());
            Ok(())
        })
        .await
    }

    async fn change_job(&self, job: &Job) -> Result<(), StoreError> {
        self.call("change a job", |kept| {
            if let Some(known) = kept.jobs.values_mut().find(|known| known.id == job.id) {
                known.clone_from(job);
            }
            Ok(())
        })
        .await
    }

    async fn job(&self, id: JobId) -> Result<Option<Job>, StoreError> {
        self.call("look up a job", |kept| {
            Ok(kept.jobs.values().find(|job| job.id == id).cloned())
        })
        .await
    }

    async fn waiting_jobs(&self) -> Result<Vec<Job>, StoreError> {
        self.call("list the queue", |kept| {
            let waiting = kept.jobs.values().filter(|job| !job.state.over());
            Ok(waiting.cloned().collect())
        })
        .await
    }

    async fn jobs_over(&self, before: Option<u64>, most: u32) -> Result<Vec<Job>, StoreError> {
        self.call("list jobs that are over", |kept| {
            let over = kept.jobs.values().rev().filter(|job| job.state.over());
            let over = over.filter(|job| before.is_none_or(|before| job.place < before));
            Ok(over.take(most as usize).cloned().collect())
        })
        .await
    }

    async fn begin_run(&self, run: &mut RunView, header: &Record) -> Result<(), StoreError> {
        self.call("begin a run", |kept| {
            if kept.records.contains_key(&run.id) {
                return Err(Kept::taken("run"));
            }
            run.place = kept.runs.last().map_or(1, |last| last.place + 1);
            kept.runs.push(run.clone());
            kept.records.insert(run.id.clone(), vec![header.clone()]);
            if let Some(job) = kept.jobs.values_mut().find(|job| job.id == run.job) {
                job.run = Some(run.id.clone());
            }
            Ok(())
        })
        .await
    }

    async fn reported(&self, run: &str, at: &str, verdict: VerdictView) -> Result<(), StoreError> {
        self.call("note a report", |kept| {
            if let Some(run) = kept.runs.iter_mut().find(|known| known.id == run) {
                run.reported = Some(at.to_owned());
                run.verdict = Some(verdict);
            }
            let of_run = |job: &&mut Job| job.run.as_deref() == Some(run);
            if let Some(job) = kept.jobs.values_mut().find(of_run) {
                job.verdict = Some(verdict);
            }
            Ok(())
        })
        .await
    }

    async fn describe_run(&self, run: &RunView) -> Result<(), StoreError> {
        self.call("describe a run", |kept| {
            if let Some(known) = kept.runs.iter_mut().find(|known| known.id == run.id) {
                known.specimen.clone_from(&run.specimen);
                known.record = run.record.clone();
            }
            Ok(())
        })
        .await
    }

    async fn archive_run(&self, run: &str, at: Option<&str>) -> Result<(), StoreError> {
        self.call("put a run away", |kept| {
            if let Some(known) = kept.runs.iter_mut().find(|known| known.id == run) {
                known.archived = at.map(str::to_owned);
            }
            Ok(())
        })
        .await
    }

    async fn delete_run(&self, run: &str) -> Result<(), StoreError> {
        self.call("delete a run", |kept| {
            kept.runs.retain(|known| known.id != run);
            kept.records.remove(run);
            for job in kept
                .jobs
                .values_mut()
                .filter(|job| job.run.as_deref() == Some(run))
            {
                (job.run, job.verdict) = (None, None);
            }
            Ok(())
        })
        .await
    }

    async fn runs(&self, query: &RunQuery) -> Result<Vec<RunView>, StoreError> {
        self.call("list the runs", |kept| {
            let latest = kept.runs.iter().rev();
            let before = latest.filter(|run| query.before.is_none_or(|before| run.place < before));
            let runs = before.filter_map(|run| kept.run(&run.id));
            let wanted = runs.filter(|run| query.matches(run));
            Ok(wanted.take(query.limit as usize).collect())
        })
        .await
    }

    async fn run(&self, id: &str) -> Result<Option<RunView>, StoreError> {
        self.call("look up a run", |kept| Ok(kept.run(id))).await
    }

    async fn append(&self, run: &str, seq: u64, record: &Record) -> Result<(), StoreError> {
        self.call("record a reading", |kept| {
            let records = kept.records.entry(run.to_owned()).or_default();
            let twice = |other: &Record| match (other, record) {
                (Record::Reading(a), Record::Reading(b)) => (a.step, a.attempt) == (b.step, b.attempt),
                _ => false,
            };
            if records.len() as u64 != seq || records.iter().any(twice) {
                return Err(Kept::taken("record"));
            }
            records.push(record.clone());
            if let Record::Extension(extension) = record
                && let Some(run) = kept.runs.iter_mut().find(|known| known.id == run)
            {
                run.planned += extension.steps.len() as u64;
            }
            Ok(())
        })
        .await
    }

    async fn records(&self, run: &str) -> Result<Vec<Record>, StoreError> {
        self.call("read a journal", |kept| {
            Ok(kept.records.get(run).cloned().unwrap_or_default())
        })
        .await
    }

    async fn latched(&self) -> Result<Option<FaultView>, StoreError> {
        self.call("look up faults", |_| Ok(None)).await
    }

    async fn audit(&self, at: &str, who: &str, what: &str, outcome: &str) -> Result<(), StoreError> {
        self.call("note who asked", |kept| {
            kept.audit.push([at, who, what, outcome].map(str::to_owned));
            Ok(())
        })
        .await
    }

    async fn close(&self) {}
}
