use async_trait::async_trait;

use crate::{Journal, JournalError, Record};

/// A journal that is gone with the process: for simulated captures, whose readings nobody needs afterwards.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MemoryJournal(pub Vec<Record>);

#[async_trait]
impl Journal for MemoryJournal {
    async fn append(&mut self, record: &Record) -> Result<(), JournalError> {
        self.0.push(record.clone());
        Ok(())
    }

    fn records(&self) -> &[Record] {
        &self.0
    }
}
