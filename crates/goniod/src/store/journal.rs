use std::sync::Arc;

use async_trait::async_trait;
use capture::{Journal, JournalError, Record};
use tokio::task::JoinHandle;

use super::{Store, StoreError};

/// A run's journal in the store.
pub(crate) struct StoreJournal {
    store: Arc<dyn Store>,
    run: String,
    records: Vec<Record>,
    /// An append that nobody waited for to its end.
    pending: Option<(Record, JoinHandle<Result<(), StoreError>>)>,
}

impl StoreJournal {
    /// The journal of a run that is in the store.
    pub(crate) async fn open(store: Arc<dyn Store>, run: &str) -> Result<Self, StoreError> {
        Ok(Self {
            records: store.records(run).await?,
            run: run.to_owned(),
            store,
            pending: None,
        })
    }

    /// Waits for the append that is under way.
    async fn settle(&mut self) -> Result<(), JournalError> {
        let Some((_, append)) = &mut self.pending else {
            return Ok(());
        };
        let result = append.await;
        let (record, _) = self.pending.take().expect("just seen");
        let refused = |source| JournalError::Store {
            run: self.run.clone(),
            source,
        };
        result
            .map_err(|error| refused(error.into()))?
            .map_err(|error| refused(error.into()))?;
        self.records.push(record);
        Ok(())
    }
}

#[async_trait]
impl Journal for StoreJournal {
    async fn append(&mut self, record: &Record) -> Result<(), JournalError> {
        self.settle().await?;
        let (store, run, seq) = (self.store.clone(), self.run.clone(), self.records.len() as u64);
        let kept = record.clone();
        // In a task of its own: a caller that goes away does not leave it open whether the record is kept.
        let append = tokio::spawn(async move { store.append(&run, seq, &kept).await });
        self.pending = Some((record.clone(), append));
        self.settle().await
    }

    fn records(&self) -> &[Record] {
        &self.records
    }

    fn room(&self) -> Option<u64> {
        self.store.room()
    }
}
