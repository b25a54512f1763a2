"""Commands, logs and figures."""

import json
import threading

import matplotlib
import numpy as np
import pytest

import foxhunt
from foxhunt import plots

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    out = tmp_path_factory.mktemp("flown")
    return foxhunt.hunt(seed=2, estimator="ekf", out=out), out / "hunt.jsonl"


def test_a_log_holds_what_was_flown(flown):
    report, path = flown
    log = foxhunt.read_log(path)
    track = log.track(0)
    assert track["error_m"].iloc[-1] == pytest.approx(report["beacons"][0]["error_m"], abs=1e-9)
    assert track["nees"].iloc[-1] == pytest.approx(report["beacons"][0]["nees"], rel=1e-9)
    assert len(log.frame("received")) >= len(track)


def test_beacons_have_names_and_mistakes_are_named(flown):
    log = foxhunt.read_log(flown[1])
    names = [each["name"] for each in log.header["beacons"]]
    assert log.track(names[1]).equals(log.track(1))
    np.testing.assert_array_equal(log.truth(names[1], 0.0), log.truth(1, 0.0))
    known = ", ".join(f"{number} {name!r}" for number, name in enumerate(names))
    for wrong in (7, -1, "no such beacon"):
        for call in (log.track, lambda beacon: plots.track(log, beacon)):
            with pytest.raises(ValueError) as caught:
                call(wrong)
            assert str(caught.value) == f"no beacon {wrong!r}; there are {known}"
    with pytest.raises(ValueError, match="no event `recieved`, expected .*`received`"):
        log.frame("recieved")
    assert log.frame("resumed").empty


def test_a_log_that_was_cut_is_read_up_to_there(flown, tmp_path):
    whole = flown[1].read_bytes()
    cut = tmp_path / "cut.jsonl"
    cut.write_bytes(whole[: len(whole) // 2])
    assert 0 < len(foxhunt.read_log(cut).events) < len(foxhunt.read_log(flown[1]).events)
    cut.write_text(whole.decode().replace("corrected", '"', 1))
    with pytest.raises(ValueError, match="cut.jsonl: line"):
        foxhunt.read_log(cut)
    assert foxhunt.read_log(flown[1].parent).events == foxhunt.read_log(flown[1]).events
    (tmp_path / "other.jsonl").touch()
    with pytest.raises(ValueError, match="cut.jsonl, other.jsonl"):
        foxhunt.read_log(tmp_path)
    cut.write_text(json.dumps({"name": "another"}) + "\n")
    with pytest.raises(ValueError, match="header"):
        foxhunt.read_log(cut)


def test_a_replay_gives_the_same_bits(flown):
    report, path = flown
    again = foxhunt.replay(path)
    same = [each["estimate"] for each in again["beacons"]]
    assert same == [each["estimate"] for each in report["beacons"]]


def test_a_campaign_is_the_same_in_parts():
    options = {"estimator": ["ekf", "ukf"]}
    whole = foxhunt.campaign("pritzl-6.1", runs=4, seed=4, **options)
    parts = [foxhunt.campaign("pritzl-6.1", runs=2, seed=seed, **options) for seed in (4, 6)]
    for part in parts:
        seeds = whole["seed"].isin(part["seed"])
        assert whole[seeds].reset_index(drop=True).equals(part)
    summary = foxhunt.run("campaign", "pritzl-6.1", runs=4, seed=4, quiet=True, **options)
    first = summary["estimators"][0]["beacons"][0]
    mine = whole[(whole["estimator"] == "ekf") & (whole["beacon"] == first["name"])]
    assert mine["error_m"].mean() == pytest.approx(first["error_m"]["mean"])
    assert mine["nees"].mean() == pytest.approx(first["anees"])


def test_a_store_is_read_by_others(tmp_path):
    pandas = pytest.importorskip("pandas")
    parquet = pytest.importorskip("pyarrow.parquet")
    store, out = tmp_path / "runs.sqlite", tmp_path / "runs.parquet"
    fixed = {"runs": 3, "seed": 4, "estimator": ["ekf", "ukf"], "quiet": True}
    summary = foxhunt.run("campaign", "pritzl-6.1", store=store, **fixed)
    # The same runs as without a store, in its own order.
    frame = foxhunt.results(store)
    flown = foxhunt.campaign("pritzl-6.1", **fixed)
    assert len(frame) == len(flown) == 12
    for name in ("seed", "estimator", "beacon", "error_m", "nees", "steps", "path_m"):
        assert frame[name].to_list() == flown[name].to_list(), name
    assert summary["runs"] == 3
    # Arrow's own reader finds the same, with types and what is absent.
    foxhunt.run("results", store, parquet=out)
    table = parquet.read_table(out)
    kinds = {field.name: str(field.type) for field in table.schema}
    assert list(kinds) == list(frame.columns)
    named = ("estimator", "seed", "error_m", "steps_to_3m")
    assert [kinds[name] for name in named] == ["string", "int64", "double", "int64"]
    assert table.column("failure").null_count == 12
    there = frame.drop(columns="failure")
    read = table.drop_columns("failure").to_pandas()
    pandas.testing.assert_frame_equal(read, there, check_dtype=False, rtol=0, atol=0)


def test_recordings_are_located(tmp_path):
    path = tmp_path / "walk.csv"
    rng = np.random.default_rng(1)
    rows = ["time_s,east_m,north_m,up_m,rss_dbm"]
    for second in range(200):
        east, north = 60 * np.cos(second / 15) + second / 10, 50 * np.sin(second / 11)
        level = -30 - 25 * np.log10(np.hypot(east - 20, north - 15)) + rng.normal(0, 2)
        rows.append(f"{second},{east:.2f},{north:.2f},1.5,{level:.2f}")
    path.write_text("\n".join(rows) + "\n")
    fix = foxhunt.locate(path, estimator="shadowing-grid")
    place = fix["estimate"]
    assert np.hypot(place["east_m"] - 20, place["north_m"] - 15) < 15
    path.write_text(path.read_text().replace(",1.5,", ",nan,", 1))
    assert [remark["code"] for remark in foxhunt.locate(path)["remarks"]][:1] == ["rows-left-out"]
    with pytest.raises(ValueError, match=r"walk\.csv.*up_m"):
        foxhunt.locate(path, strict=True)


def test_other_threads_go_on_meanwhile():
    ticks = []
    over = threading.Event()

    def tick():
        while not over.wait(0.001):
            ticks.append(1)

    thread = threading.Thread(target=tick)
    thread.start()
    foxhunt.hunt(seed=1)
    over.set()
    thread.join()
    assert len(ticks) > 3


def test_figures_are_drawn(flown):
    log = foxhunt.read_log(flown[1])
    assert len(plots.track(log, 1).get_lines()) == 4
    frame = foxhunt.campaign("pritzl-6.1", runs=3, estimator=["ekf", "ukf"])
    assert len(plots.errors(frame).get_lines()) == 2
    with pytest.raises(ValueError, match="no estimator; .* campaign"):
        plots.errors(log.track(0))
    motion, model = foxhunt.Motion.random_walk(0.1), foxhunt.Model.bearing()
    cloud = foxhunt.ParticleFilter(motion, model, [5, 1], np.eye(2), particles=300)
    assert len(plots.belief(cloud).collections[0].get_offsets()) == 300


def test_flags_are_what_keywords_become():
    with pytest.raises(ValueError, match="--no-such-flag"):
        foxhunt.run("hunt", no_such_flag=3)
    assert foxhunt.run("campaign", runs=1, estimator="ekf", quiet=True, seed=9)["seed"] == 9
    assert isinstance(foxhunt.run("list", "estimators"), list)
