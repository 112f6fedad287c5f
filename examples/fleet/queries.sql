-- Questions to a table of incidents, for DuckDB and PostgreSQL.
-- Times are UTC. Change the hours to those of your shifts.

-- Which connection leaves Data most often, for each machine and shift?
WITH losses AS (
    SELECT machine,
        CASE
            WHEN extract(hour FROM utc) BETWEEN 6 AND 13 THEN 'early'
            WHEN extract(hour FROM utc) BETWEEN 14 AND 21 THEN 'late'
            ELSE 'night'
        END AS shift,
        connection, count(*) AS incidents
    FROM incidents
    WHERE kind = 'left_data'
    GROUP BY 1, 2, 3
), ranked AS (
    SELECT *, row_number() OVER (
        PARTITION BY machine, shift ORDER BY incidents DESC, connection
    ) AS place
    FROM losses
)
SELECT machine, shift, connection, incidents FROM ranked WHERE place = 1 ORDER BY 1, 2;

-- Which causes are likely, and on how many machines?
SELECT cause, count(*) AS incidents, count(DISTINCT machine) AS machines
FROM incidents
WHERE cause <> ''
GROUP BY 1
ORDER BY 2 DESC, 1;

-- Which end resets with which code?
SELECT reset_by, reset_cause, count(*) AS incidents
FROM incidents
WHERE reset_code IS NOT NULL
GROUP BY 1, 2
ORDER BY 3 DESC, 1, 2;

-- Which incidents repeat an earlier one of the same connection within ten minutes?
WITH pairs AS (
    SELECT machine, connection, utc, lag(utc) OVER (
        PARTITION BY machine, connection ORDER BY utc
    ) AS before
    FROM incidents
    WHERE kind = 'left_data'
)
SELECT machine, connection, count(*) AS repeats
FROM pairs
WHERE utc - before <= INTERVAL '10 minutes'
GROUP BY 1, 2
ORDER BY 3 DESC, 1, 2;

-- Which plans have lost frames or late cycles in their incidents?
SELECT plan_sha256, count(*) AS incidents, sum(lost_frames) AS lost, sum(late_cycles) AS late
FROM incidents
GROUP BY 1
HAVING sum(lost_frames) + sum(late_cycles) > 0
ORDER BY 2 DESC, 1;
