-- What the checks said of a run's result when its files were written last; NULL before, and where an older version wrote them.
ALTER TABLE runs ADD COLUMN verdict TEXT;
