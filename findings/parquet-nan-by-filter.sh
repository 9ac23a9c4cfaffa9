#!/usr/bin/env bash
# version: pyarrow 26.0.1, duckdb 2.0.1 (PyPI)
# pyarrow 26.0.1 and DuckDB 2.0.1: a NaN in a Parquet file is not found by a filter on the file that finds it in memory.
# Expected: the same rows from file and memory. Seen: column statistics leave NaN out, so the row group is skipped.
# What we do: no NaN is ever written to results, steps or timing; what is not known is null.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet pyarrow==26.0.1 duckdb==2.0.1
venv/bin/python - > seen <<'PY'
import duckdb
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

rows = pa.table({"v": [1.0, float("nan"), 3.0]})
pq.write_table(rows, "nan.parquet")
beyond = ~(pc.field("v") <= 3)
print("pyarrow, not v <= 3:", rows.filter(beyond).num_rows, "in memory,", pq.read_table("nan.parquet", filters=beyond).num_rows, "in the file")
count = lambda source: duckdb.sql(f"select count(*) from {source} where isnan(v)").fetchall()[0][0]
print("DuckDB, isnan(v):", count("rows"), "in memory,", count("'nan.parquet'"), "in the file")
PY
cat seen
diff - seen <<'TXT'
pyarrow, not v <= 3: 1 in memory, 0 in the file
DuckDB, isnan(v): 1 in memory, 0 in the file
TXT
