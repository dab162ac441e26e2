//! The history: which runs somebody wants to see, and what is said of them.

use sqlx::{QueryBuilder, Sqlite, SqliteConnection};

use super::RUN;
use super::row::{json, word};
use crate::history::{folded, searched};
use crate::{RunQuery, RunView};

/// A place before which all others are, where none is named.
pub(super) fn bound(before: Option<u64>) -> i64 {
    before.map_or(i64::MAX, |before| i64::try_from(before).unwrap_or(i64::MAX))
}

/// The statement for a query. It reads from the index that leaves the fewest, in the order of places, so that it ends
/// after as many rows as are wanted, however many there are.
pub(super) fn select(query: &RunQuery) -> QueryBuilder<Sqlite> {
    let needles = query.needles();
    let tag = query.tag.as_deref().map(folded);
    let (by_words, by_tag) = (!needles.is_empty(), needles.is_empty() && tag.is_some());
    let (source, place) = match (by_words, by_tag) {
        (true, _) => (
            "run_words CROSS JOIN runs ON runs.place = run_words.rowid JOIN jobs ON jobs.id = runs.job",
            "run_words.rowid",
        ),
        (_, true) => (
            "run_tags CROSS JOIN runs ON runs.place = run_tags.place JOIN jobs ON jobs.id = runs.job",
            "run_tags.place",
        ),
        _ => ("runs JOIN jobs ON jobs.id = runs.job", "runs.place"),
    };
    let mut select = QueryBuilder::new(RUN);
    select.push(source);
    select
        .push(format!(" WHERE {place} < "))
        .push_bind(bound(query.before));
    if by_words {
        // Letters and digits alone stand between the quotes.
        let all: Vec<String> = needles.iter().map(|needle| format!("\"{needle}\"*")).collect();
        select.push(" AND run_words MATCH ").push_bind(all.join(" AND "));
    }
    match tag {
        Some(tag) if by_tag => {
            select.push(" AND run_tags.tag = ").push_bind(tag);
        }
        Some(tag) => {
            select
                .push(" AND EXISTS (SELECT 1 FROM run_tags WHERE run_tags.place = runs.place AND run_tags.tag = ")
                .push_bind(tag)
                .push(")");
        }
        None => {}
    }
    for (column, wanted) in [
        ("operator", query.operator.clone()),
        ("project", query.project.clone()),
        ("state", query.state.as_ref().map(word)),
    ] {
        if let Some(wanted) = wanted {
            select.push(format!(" AND runs.{column} = ")).push_bind(wanted);
        }
    }
    if let Some(specimen) = &query.specimen {
        select
            .push(" AND (runs.specimen = ")
            .push_bind(specimen.clone())
            .push(" OR runs.specimen_id = ")
            .push_bind(specimen.clone())
            .push(")");
    }
    if let Some(from) = &query.from {
        select.push(" AND runs.started >= ").push_bind(from.clone());
    }
    if let Some(until) = query.until() {
        select.push(" AND runs.started <= ").push_bind(until);
    }
    select.push(match query.archived {
        true => " AND runs.archived IS NOT NULL",
        false => " AND runs.archived IS NULL",
    });
    select
        .push(format!(" ORDER BY {place} DESC LIMIT "))
        .push_bind(i64::from(query.limit));
    select
}

/// Keeps what is said of a run, and the words and tags by which it is found.
pub(super) async fn describe(connection: &mut SqliteConnection, run: &RunView) -> sqlx::Result<()> {
    let record = &run.record;
    sqlx::query(
        "UPDATE runs SET specimen = $2, specimen_id = $3, material = $4, tags = $5, notes = $6, operator = $7, project = \
         $8, edited = $9, edited_by = $10 WHERE id = $1",
    )
    .bind(&run.id)
    .bind(&run.specimen)
    .bind(&record.specimen_id)
    .bind(&record.material)
    .bind(json(&record.tags))
    .bind(&record.notes)
    .bind(&record.operator)
    .bind(&record.project)
    .bind(&record.edited)
    .bind(&record.edited_by)
    .execute(&mut *connection)
    .await?;
    let place = bound(Some(run.place));
    forget(connection, place).await?;
    for tag in &record.tags {
        sqlx::query("INSERT INTO run_tags (tag, place) VALUES ($1, $2) ON CONFLICT DO NOTHING")
            .bind(folded(tag))
            .bind(place)
            .execute(&mut *connection)
            .await?;
    }
    sqlx::query("INSERT INTO run_words (rowid, words) VALUES ($1, $2)")
        .bind(place)
        .bind(searched(run))
        .execute(&mut *connection)
        .await?;
    Ok(())
}

/// Forgets a run with its journal.
pub(super) async fn delete(connection: &mut SqliteConnection, run: &str) -> sqlx::Result<()> {
    let place: Option<i64> = sqlx::query_scalar("SELECT place FROM runs WHERE id = $1")
        .bind(run)
        .fetch_optional(&mut *connection)
        .await?;
    let Some(place) = place else { return Ok(()) };
    forget(connection, place).await?;
    for statement in [
        "DELETE FROM records WHERE run = $1",
        "UPDATE jobs SET run = NULL WHERE run = $1",
        "DELETE FROM runs WHERE id = $1",
    ] {
        sqlx::query(statement).bind(run).execute(&mut *connection).await?;
    }
    Ok(())
}

/// Forgets by what a run is found.
async fn forget(connection: &mut SqliteConnection, place: i64) -> sqlx::Result<()> {
    for statement in [
        "DELETE FROM run_tags WHERE place = $1",
        "DELETE FROM run_words WHERE rowid = $1",
    ] {
        sqlx::query(statement)
            .bind(place)
            .execute(&mut *connection)
            .await?;
    }
    Ok(())
}
