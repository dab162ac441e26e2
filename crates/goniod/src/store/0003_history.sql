-- The record of a run, and what the history is searched by. All but the index of words is portable.

-- Order in which the runs began; the clock may step back.
ALTER TABLE runs ADD COLUMN place BIGINT;
-- What the run's job says of itself, so that the history need not look there.
ALTER TABLE runs ADD COLUMN state TEXT NOT NULL DEFAULT 'queued';
ALTER TABLE runs ADD COLUMN accepted BIGINT NOT NULL DEFAULT 0;
ALTER TABLE runs ADD COLUMN specimen TEXT NOT NULL DEFAULT '';
ALTER TABLE runs ADD COLUMN specimen_id TEXT NOT NULL DEFAULT '';
ALTER TABLE runs ADD COLUMN material TEXT NOT NULL DEFAULT '';
-- A JSON array, as they are spelled; run_tags has them as they are looked for.
ALTER TABLE runs ADD COLUMN tags TEXT NOT NULL DEFAULT '[]';
ALTER TABLE runs ADD COLUMN notes TEXT NOT NULL DEFAULT '';
ALTER TABLE runs ADD COLUMN operator TEXT NOT NULL DEFAULT '';
ALTER TABLE runs ADD COLUMN project TEXT NOT NULL DEFAULT '';
ALTER TABLE runs ADD COLUMN edited TEXT;
ALTER TABLE runs ADD COLUMN edited_by TEXT;
ALTER TABLE runs ADD COLUMN archived TEXT;
-- Whether the run directory gets all files, also those that can be made when somebody asks for them.
ALTER TABLE jobs ADD COLUMN whole SMALLINT NOT NULL DEFAULT 0;

UPDATE runs SET
    place = (SELECT jobs.place FROM jobs WHERE jobs.id = runs.job),
    state = (SELECT jobs.state FROM jobs WHERE jobs.id = runs.job),
    specimen = (SELECT jobs.specimen FROM jobs WHERE jobs.id = runs.job),
    operator = (SELECT jobs.submitted_by FROM jobs WHERE jobs.id = runs.job),
    accepted = (SELECT COUNT(*) FROM records WHERE records.run = runs.id AND records.accepted = 1);

CREATE UNIQUE INDEX runs_by_place ON runs (place);
CREATE INDEX runs_by_job ON runs (job);
CREATE INDEX runs_by_state ON runs (state, place);
CREATE INDEX runs_by_specimen ON runs (specimen, place);
CREATE INDEX runs_by_specimen_id ON runs (specimen_id, place);
CREATE INDEX runs_by_operator ON runs (operator, place);
CREATE INDEX runs_by_project ON runs (project, place);
CREATE INDEX runs_put_away ON runs (place) WHERE archived IS NOT NULL;
CREATE INDEX jobs_over ON jobs (place) WHERE state IN ('done', 'failed', 'cancelled');

CREATE TABLE run_tags (
    tag TEXT NOT NULL,
    place BIGINT NOT NULL REFERENCES runs (place),
    PRIMARY KEY (tag, place)
);

-- SQLite's own: one row a run, by its place.
CREATE VIRTUAL TABLE run_words USING fts5 (words, tokenize = "unicode61 remove_diacritics 0", prefix = '2 3');
INSERT INTO run_words (rowid, words)
    SELECT runs.place, jobs.specimen || ' ' || jobs.name || ' ' || runs.id || ' ' || jobs.submitted_by
    FROM runs JOIN jobs ON jobs.id = runs.job;
