-- The queue, the runs and their journals. Portable: types and clauses that SQLite and PostgreSQL share.

-- One row a start of the daemon: event ids of a later life are larger.
CREATE TABLE lives (
    life BIGINT PRIMARY KEY,
    started TEXT NOT NULL
);

CREATE TABLE jobs (
    id TEXT PRIMARY KEY,
    -- Order of the queue; the clock may step back.
    place BIGINT NOT NULL UNIQUE,
    name TEXT NOT NULL,
    specimen TEXT NOT NULL,
    on_stage SMALLINT NOT NULL,
    body TEXT NOT NULL,
    state TEXT NOT NULL,
    why TEXT,
    run TEXT,
    submitted_by TEXT NOT NULL,
    submitted TEXT NOT NULL,
    changed TEXT NOT NULL
);
CREATE INDEX jobs_by_state ON jobs (state);

CREATE TABLE runs (
    id TEXT PRIMARY KEY,
    job TEXT NOT NULL REFERENCES jobs (id),
    directory TEXT NOT NULL,
    planned BIGINT NOT NULL,
    started TEXT NOT NULL,
    reported TEXT
);

-- Journals: every record as JSON, in its order. A reading also says which one it is, so that none is there twice.
CREATE TABLE records (
    run TEXT NOT NULL REFERENCES runs (id),
    seq BIGINT NOT NULL,
    kind TEXT NOT NULL,
    step BIGINT,
    attempt BIGINT,
    accepted SMALLINT,
    body TEXT NOT NULL,
    PRIMARY KEY (run, seq),
    UNIQUE (run, step, attempt)
);

CREATE TABLE faults (
    seq BIGINT PRIMARY KEY,
    code TEXT NOT NULL,
    what TEXT NOT NULL,
    at TEXT NOT NULL,
    run TEXT,
    acknowledged TEXT,
    acknowledged_by TEXT
);

-- Who asked what, and what came of it.
CREATE TABLE audit (
    seq BIGINT PRIMARY KEY,
    at TEXT NOT NULL,
    who TEXT NOT NULL,
    what TEXT NOT NULL,
    outcome TEXT NOT NULL
);
