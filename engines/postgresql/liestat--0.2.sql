-- Means of headings, directions and rotations by states that merge: docs/postgresql.md.
\echo Use "CREATE EXTENSION liestat" to load this file. \quit

CREATE TYPE liestat_mean AS (degrees float8, mean float8[], covariance float8[], resultant float8, step float8, n int8,
  left_out int8, status text, reason text, another_pass bool);

CREATE FUNCTION liestat_combine(internal, internal) RETURNS internal AS 'MODULE_PATHNAME' LANGUAGE C IMMUTABLE PARALLEL SAFE;
CREATE FUNCTION liestat_merge_step(internal, bytea) RETURNS internal AS 'MODULE_PATHNAME' LANGUAGE C IMMUTABLE PARALLEL SAFE;
CREATE FUNCTION liestat_bytes(internal) RETURNS bytea AS 'MODULE_PATHNAME' LANGUAGE C IMMUTABLE PARALLEL SAFE;
CREATE FUNCTION liestat_group(bytea, internal) RETURNS internal AS 'MODULE_PATHNAME' LANGUAGE C IMMUTABLE STRICT PARALLEL SAFE;
CREATE FUNCTION liestat_mean_of_group(internal) RETURNS liestat_mean AS 'MODULE_PATHNAME' LANGUAGE C IMMUTABLE PARALLEL SAFE;
CREATE FUNCTION liestat_degrees_of_group(internal) RETURNS float8 AS 'MODULE_PATHNAME' LANGUAGE C IMMUTABLE PARALLEL SAFE;
CREATE FUNCTION liestat_result(state bytea) RETURNS liestat_mean AS 'MODULE_PATHNAME' LANGUAGE C IMMUTABLE STRICT PARALLEL SAFE;

CREATE AGGREGATE liestat_merge(state bytea) (SFUNC = liestat_merge_step, STYPE = internal, SSPACE = 1120,
  FINALFUNC = liestat_bytes, COMBINEFUNC = liestat_combine, SERIALFUNC = liestat_bytes, DESERIALFUNC = liestat_group,
  PARALLEL = SAFE);

-- The aggregates of each feature, with weights and without: NAME_mean, NAME_state, and NAME_sums at the mean of a state.
-- Their step functions are not STRICT, so that rows with NULL are counted.
DO $liestat$
DECLARE
  feature record;
  columns text;
  more text;
BEGIN
  FOR feature IN SELECT * FROM (VALUES ('heading', 'float8', 'liestat_degrees_of_group'),
      ('direction', 'float8, float8, float8', 'liestat_mean_of_group'),
      ('rotation', 'float8, float8, float8, float8', 'liestat_mean_of_group')) AS list(name, columns, final) LOOP
    more := 'STYPE = internal, SSPACE = 1120, COMBINEFUNC = liestat_combine, SERIALFUNC = liestat_bytes, '
      'DESERIALFUNC = liestat_group, PARALLEL = SAFE';
    FOREACH columns IN ARRAY ARRAY[feature.columns, feature.columns || ', float8'] LOOP
      EXECUTE format('CREATE FUNCTION liestat_%s_step(internal, %s) RETURNS internal AS ''MODULE_PATHNAME'' LANGUAGE C '
        'IMMUTABLE PARALLEL SAFE', feature.name, columns);
      EXECUTE format('CREATE FUNCTION liestat_%s_sums_step(internal, %s, bytea) RETURNS internal AS ''MODULE_PATHNAME'' '
        'LANGUAGE C IMMUTABLE PARALLEL SAFE', feature.name, columns);
      EXECUTE format('CREATE AGGREGATE %s_mean(%s) (SFUNC = liestat_%1$s_step, FINALFUNC = %3$s, %4$s)', feature.name,
        columns, feature.final, more);
      EXECUTE format('CREATE AGGREGATE %s_state(%s) (SFUNC = liestat_%1$s_step, FINALFUNC = liestat_bytes, %3$s)',
        feature.name, columns, more);
      EXECUTE format('CREATE AGGREGATE %s_sums(%s, bytea) (SFUNC = liestat_%1$s_sums_step, FINALFUNC = liestat_bytes, '
        '%3$s)', feature.name, columns, more);
    END LOOP;
  END LOOP;
END $liestat$;

-- The Fréchet mean of a feature's columns, and a weight if there is one more, of a table or '(query) AS name', in as
-- many passes as it takes: frechet_mean('rotation', 'x, y, z, w', 'poses').
CREATE FUNCTION frechet_mean(feature text, columns text, source text, OUT result liestat_mean, OUT passes int)
LANGUAGE plpgsql STABLE AS $liestat$
DECLARE
  state bytea;
BEGIN
  IF feature NOT IN ('heading', 'direction', 'rotation') THEN
    RAISE EXCEPTION 'frechet_mean: feature % is none of heading, direction, rotation', feature;
  END IF;
  EXECUTE format('SELECT %s_state(%s) FROM %s', feature, columns, source) INTO state;
  passes := 1;
  result := liestat_result(state);
  WHILE result.mean IS NOT NULL AND (passes = 1 OR result.another_pass) LOOP
    EXECUTE format('SELECT %s_sums(%s, $1) FROM %s', feature, columns, source) INTO state USING state;
    passes := passes + 1;
    result := liestat_result(state);
  END LOOP;
END $liestat$;
