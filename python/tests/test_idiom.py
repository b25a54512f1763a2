"""What people of Python expect: tables in memory, copies and pickles, typed keywords, reprs."""

import copy
import importlib.util
import inspect
import io
import pickle
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import foxhunt

KINDS = [foxhunt.Ekf, foxhunt.Ukf, foxhunt.Ckf, foxhunt.ParticleFilter, foxhunt.GridFilter]
RECEIVERS = np.random.default_rng(4).uniform(-50, 50, (8, 3)) * [1, 1, 0.1]


class Range:
    """A vectorised model at the top of a module, which can be pickled."""

    quantities = [("range_m", "linear")]
    vectorized = True

    def expected(self, state, receiver):
        return np.hypot(state[..., 0] - receiver[0], state[..., 1] - receiver[1])


class Scaled(Range):
    scale = 1.0

    def expected(self, state, receiver):
        return self.scale * super().expected(state, receiver)


class OneByOne(Range):
    vectorized = False


class Drift:
    """Motion.random_walk(0.5), vectorised."""

    vectorized = True

    def propagate(self, state, dt):
        return state

    def noise_factor(self, state, dt):
        return 0.5 * np.sqrt(dt) * np.eye(state.shape[-1])


def stepped(estimator, receivers=RECEIVERS):
    for receiver in receivers:
        estimator.predict(1.0)
        estimator.update([np.hypot(*(receiver[:2] - [20, 15]))], [2.0], receiver=receiver)
    return estimator


def made(kind, model=None):
    return kind(foxhunt.Motion.random_walk(0.5), model or Range(), [5, 5], 900 * np.eye(2))


def same(one, other):
    np.testing.assert_array_equal(one.estimate().mean, other.estimate().mean)
    np.testing.assert_array_equal(one.estimate().covariance, other.estimate().covariance)
    for ours, theirs in zip(one.samples(), other.samples()):
        np.testing.assert_array_equal(ours, theirs)


@pytest.fixture(scope="module")
def walk():
    rng = np.random.default_rng(1)
    second = np.arange(200.0)
    east, north = 60 * np.cos(second / 15) + second / 10, 50 * np.sin(second / 11)
    level = -30 - 25 * np.log10(np.hypot(east - 20, north - 15)) + rng.normal(0, 2, 200)
    up = np.full(200, 1.5)
    return {"time_s": second, "east_m": east, "north_m": north, "up_m": up, "rss_dbm": level}


def structured(walk):
    return pd.DataFrame(walk).to_records(index=False)


TABLES = [dict, pd.DataFrame, pl.DataFrame, pa.table, structured]


@pytest.mark.parametrize("table", TABLES, ids=["dict", "pandas", "polars", "arrow", "records"])
def test_tables_in_memory_are_files(walk, tmp_path, table):
    path = tmp_path / "table.csv"
    pd.DataFrame(walk).to_csv(path, index=False)
    of_file = foxhunt.locate(path)
    of_table = foxhunt.locate(table(walk))
    assert of_table["estimate"] == of_file["estimate"]
    assert str(tmp_path.parent.parent) not in str(of_table)


def test_a_table_that_is_read_whole_prints_nothing(walk, capfd):
    foxhunt.locate(walk)
    assert capfd.readouterr() == ("", "")
    up = [*walk["up_m"][:-1], "high"]
    foxhunt.locate({**walk, "up_m": up})
    printed = capfd.readouterr().err
    assert printed.startswith("table.csv: format foxhunt, 199 of 200 rows\n")


@pytest.mark.parametrize("pair", [tuple, list, np.array, lambda pair: "50.0755,14.4378"])
def test_a_place_is_a_pair_of_numbers(walk, tmp_path, pair):
    export = tmp_path / "place.geojson"
    foxhunt.locate(walk, origin=pair((50.0755, 14.4378)), export=export)
    foxhunt.run("locate", walk, origin=pair((50.0755, 14.4378)), export=export)
    assert "50.07" in export.read_text()
    with pytest.raises(ValueError, match="truth"):
        foxhunt.locate(walk, truth=pair((90.0, 75.0)))


def test_a_table_s_mistakes_are_named(walk):
    with pytest.raises(ValueError, match=r"(?s)^table\.csv.*up_m"):
        foxhunt.locate(pd.DataFrame({**walk, "up_m": "high"}), strict=True)
    with pytest.raises(ValueError, match="differ in length"):
        foxhunt.locate({"time_s": [1.0, 2.0], "east_m": [1.0]})
    with pytest.raises(ValueError, match="no columns"):
        foxhunt.locate({})
    with pytest.raises(TypeError, match="of the type list; it must be a path or a table"):
        foxhunt.locate([walk])


def test_bearings_of_a_table(walk):
    north, east = 15 - walk["north_m"], 20 - walk["east_m"]
    compass = np.degrees(np.arctan2(east, north)) % 360
    frame = pd.DataFrame({**walk, "bearing_deg_compass": compass}).drop(columns="rss_dbm")
    place = foxhunt.locate(frame[::20])["estimate"]
    assert np.hypot(place["east_m"] - 20, place["north_m"] - 15) < 1.0


def test_turns_of_a_table(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    boresight = np.tile(np.arange(0.0, 360.0, 10.0), 2)
    level = -60 + 6 * np.cos(np.radians(boresight - 70))
    turns = {
        "time_s": np.arange(72.0),
        "east_m": np.zeros(72),
        "north_m": np.zeros(72),
        "up_m": np.ones(72),
        "boresight_deg_compass": boresight,
        "rss_dbm": level,
    }
    pd.DataFrame(turns).to_csv("table.csv", index=False)
    found = foxhunt.bearing(pl.DataFrame(turns))
    assert found == foxhunt.bearing("table.csv")
    assert "bearing" in str(found)


def test_a_table_is_judged(walk, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    north, east = 15 - walk["north_m"], 20 - walk["east_m"]
    compass = np.degrees(np.arctan2(east, north)) % 360
    errors = np.random.default_rng(2).normal(0, 2, 200)
    table = {**walk, "bearing_deg_compass": (compass + errors) % 360}
    del table["rss_dbm"]
    for name, value in (("truth_east_m", 20.0), ("truth_north_m", 15.0)):
        table[name] = np.full(200, value)
    pd.DataFrame(table).to_csv("table.csv", index=False)
    assert foxhunt.judge(table)["fixes"] == foxhunt.judge("table.csv")["fixes"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("way", ["pickle", "copy", "deepcopy", "joblib"])
def test_estimators_go_through_copies_and_pickles(kind, way):
    def sent(estimator):
        if way == "joblib":
            file = io.BytesIO()
            joblib.dump(estimator, file)
            file.seek(0)
            return joblib.load(file)
        if way == "pickle":
            return pickle.loads(pickle.dumps(estimator))
        return getattr(copy, way)(estimator)

    estimator = stepped(made(kind))
    with pytest.raises(ValueError):
        estimator.update([np.nan], [1.0])
    estimator.note = "own attribute"
    again = sent(estimator)
    assert type(again) is kind and again.note == "own attribute"
    same(again, estimator)
    # From there on they go apart, each as the other would.
    stepped(again)
    before = estimator.estimate().mean
    assert not np.array_equal(again.estimate().mean, before)
    same(stepped(estimator), again)


def test_a_pickle_whose_model_was_changed_is_refused():
    class_of = made(foxhunt.Ekf, Scaled())
    sent = pickle.dumps(stepped(class_of))
    same(pickle.loads(sent), class_of)
    model = Scaled()
    changed = stepped(made(foxhunt.Ekf, model))
    model.scale = 1.1
    with pytest.raises(ValueError, match="pickled Ekf .*model was changed between two steps"):
        pickle.loads(pickle.dumps(stepped(changed)))


def test_work_goes_to_other_processes():
    estimators = [stepped(made(kind)) for kind in KINDS]
    here = [stepped(copy.deepcopy(each)).estimate() for each in estimators]
    there = joblib.Parallel(n_jobs=2)(joblib.delayed(_final)(each) for each in estimators)
    for ours, theirs in zip(here, there):
        np.testing.assert_array_equal(ours.mean, theirs.mean)


def _final(estimator):
    return stepped(estimator).estimate()


def test_a_long_run_is_copied_and_not_pickled():
    ekf = foxhunt.Ekf(foxhunt.Motion.random_walk(0.1), foxhunt.Model.bearing(), [9, 1], np.eye(2))
    for _ in range(100_001):
        ekf.predict(1e-3)
    same(copy.deepcopy(ekf), ekf)
    with pytest.raises(ValueError, match="copy.deepcopy"):
        pickle.dumps(ekf)


def test_motions_models_and_results_are_written_out_as_they_are_made():
    made = [
        foxhunt.Motion.random_walk([0.1, 0.2]),
        foxhunt.Motion.constant_velocity(0.09),
        foxhunt.Motion.coordinated_turn(0.09, turn_rate_drift=0.02),
        foxhunt.Model.rss(-29.06, 2.765),
        foxhunt.Model.bearing(),
        foxhunt.Model.rss_bearing(-29.06, 2.765, target_up=1.5),
        foxhunt.Model.free_power(2.765),
        foxhunt.Model.free_path_loss(),
        foxhunt.Model.range_difference([1, 2, 3]),
        foxhunt.Correction(False, nis=0.37),
    ]
    for each in made:
        assert repr(pickle.loads(pickle.dumps(each))) == repr(each)
        assert repr(eval(repr(each), vars(foxhunt))) == repr(each)
    assert repr(made[1]) == "Motion.constant_velocity(spectral_density=0.09)"
    assert repr(made[-1]) == "Correction(rejected=False, nis=0.37)"
    estimate = foxhunt.Estimate(np.array([1.0, 2.0]), np.eye(2))
    assert repr(estimate).startswith("Estimate(mean=array([1., 2.])")
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(estimate)).covariance, np.eye(2))
    ekf = foxhunt.Ekf(made[1], made[4], [5, 1, 0, 0], np.eye(4))
    assert "Motion.constant_velocity(spectral_density=0.09)" in repr(ekf)


@pytest.mark.parametrize("kind", [foxhunt.ParticleFilter, foxhunt.GridFilter])
def test_a_vectorised_model_changes_nothing(kind):
    fast, slow = stepped(made(kind, Range())), stepped(made(kind, OneByOne()))
    np.testing.assert_allclose(fast.estimate().mean, slow.estimate().mean, rtol=1e-9)
    np.testing.assert_allclose(fast.estimate().covariance, slow.estimate().covariance, rtol=1e-6)


def test_a_vectorised_motion_changes_nothing():
    prior = ([5, 5], 900 * np.eye(2))
    fast = stepped(foxhunt.ParticleFilter(Drift(), Range(), *prior))
    np.testing.assert_allclose(
        fast.estimate().mean, stepped(made(foxhunt.ParticleFilter)).estimate().mean, rtol=1e-9
    )


def test_a_vectorised_model_of_the_wrong_shape_is_named():
    class Wrong(Range):
        def expected(self, state, receiver):
            return state[..., :1].sum(axis=0) * np.ones(3)

    with pytest.raises(ValueError, match="expected"):
        made(foxhunt.ParticleFilter, Wrong()).update([1.0], [1.0])


def test_receivers_are_arrays_and_poses():
    class Doppler:
        """The range rate of a still target."""

        quantities = [("range_rate_mps", "linear")]

        def expected(self, state, receiver):
            way = state[:2] - receiver[:2]
            return [-(way @ receiver.velocity[:2]) / np.hypot(*way)]

    def run(*arguments, **keywords):
        ukf = foxhunt.Ukf(
            foxhunt.Motion.random_walk(0.1), Doppler(), [30, 10], 100 * np.eye(2)
        )
        ukf.update(-8.0, 0.5, *arguments, **keywords)
        return ukf.estimate().mean

    pose = foxhunt.Pose([1, 2], heading=0.5, velocity=(9, 0))
    expected = run(receiver=pose)
    for receiver in ([1, 2], np.array([1.0, 2.0, 0.0]), (1, 2, 0), pd.Series([1, 2])):
        np.testing.assert_array_equal(run(receiver=receiver, velocity=[9, 0]), expected)
    assert not np.array_equal(run(receiver=pose, velocity=[0, 9]), expected)
    with pytest.raises(ValueError, match="receiver is .*2 or 3 numbers"):
        run(receiver=[1, 2, 3, 4], velocity=[9, 0])
    assert repr(pickle.loads(pickle.dumps(pose))) == repr(pose) != repr(foxhunt.Pose([1, 2]))
    # A sum of places is an array, and no pose.
    assert type(pose + 1) is np.ndarray and type(pose[:2]) is np.ndarray


def test_an_angle_in_degrees_is_refused_by_its_name():
    class Degrees(Range):
        quantities = [("bearing_deg", "angle")]

    with pytest.raises(ValueError, match="bearing_deg .* radians"):
        made(foxhunt.Ekf, Degrees())


@pytest.mark.parametrize("size", range(2, 9))
def test_states_of_many_sizes(size):
    class Place:
        quantities = [("a", "linear"), ("b", "linear"), ("c", "linear")]

        def expected(self, state, receiver):
            return np.resize(state, 3)

    prior = (np.zeros(size), np.eye(size))
    ekf = foxhunt.Ekf(foxhunt.Motion.random_walk(0.1), Place(), *prior)
    ekf.update([1.0, 1.0, None], np.ones(3))
    assert ekf.estimate().mean.shape == (size,)


@pytest.mark.parametrize(("motion", "size"), [("constant_velocity", 6), ("coordinated_turn", 7)])
def test_motions_in_space(motion, size):
    class Place:
        quantities = [("east_m", "linear"), ("north_m", "linear"), ("up_m", "linear")]

        def expected(self, state, receiver):
            return state[:3]

    arguments = (0.01,) if motion == "constant_velocity" else (0.01, 1e-3)
    made = getattr(foxhunt.Motion, motion)(*arguments)
    ukf = foxhunt.Ukf(made, Place(), np.zeros(size), 25 * np.eye(size))
    for second in range(1, 40):
        ukf.predict(1.0)
        ukf.update([2.0 * second, -1.0 * second, 0.5 * second], np.full(3, 0.1))
    np.testing.assert_allclose(ukf.estimate().mean[3:6], [2.0, -1.0, 0.5], atol=0.1)


def test_estimators_are_judged():
    rng = np.random.default_rng(7)
    nees, innovations = [], []
    for _ in range(200):
        truth = rng.normal(0, 2, 2)
        ekf = foxhunt.Ekf(
            foxhunt.Motion.random_walk(0.0), foxhunt.Model.bearing(), [0, 0], 4 * np.eye(2)
        )
        for receiver in rng.uniform(40, 90, (5, 2)):
            way = truth - receiver
            bearing = np.arctan2(way[1], way[0]) + rng.normal(0, 0.02)
            ekf.update(bearing, 0.02, receiver=receiver)
        nees.append(ekf.nees(truth))
        innovations.append(rng.normal(size=(20, 2)))
    judged = foxhunt.consistency(nees, 2, probability=0.99)
    assert judged.verdict == "consistent", judged
    assert judged.interval[0] < judged.expected < judged.interval[1]
    assert foxhunt.consistency(np.multiply(nees, 0.5), 2).verdict == "under-confident"
    assert foxhunt.whiteness(innovations, lags=5).lags == 5
    with pytest.raises(ValueError, match="probability"):
        foxhunt.consistency(nees, 2, probability=2.0)
    for wrong in (None, np.nan, -1.0, np.inf):
        with pytest.raises(ValueError, match=rf"squares\[1\] is {wrong}; "):
            foxhunt.consistency([4.0, wrong], 4)


def test_a_moving_beacon_is_followed(tmp_path):
    report = foxhunt.hunt("isaacs-circle", seed=3, out=tmp_path)
    log = foxhunt.read_log(tmp_path / "hunt.jsonl")
    track = log.track()
    assert track["error_m"].iloc[-1] == pytest.approx(report["beacons"][0]["error_m"], abs=0.2)
    first, last = log.truth(0, [0.0, track["time"].iloc[-1]])
    assert np.hypot(*(last - first)) > 0.1
    # The truth's way, beside receptions, estimate, ellipse and its last place.
    assert len(foxhunt.plots.track(log).get_lines()) == 5


def test_commands_are_generated_from_the_program():
    path = Path(__file__).parents[1] / "tools" / "commands.py"
    spec = importlib.util.spec_from_file_location("commands_tool", path)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    installed = Path(foxhunt.commands.__file__).read_text(encoding="utf-8")
    assert installed == tool.text(), "run tools/commands.py and build the wheel"


@pytest.mark.parametrize("name", [name for name in foxhunt.commands.__all__ if name.islower()])
def test_every_keyword_has_a_type_and_a_help(name):
    function = getattr(foxhunt.commands, name)
    if name == "run":
        return
    text = inspect.getdoc(function)
    for parameter in inspect.signature(function).parameters.values():
        assert parameter.kind is not parameter.VAR_KEYWORD
        assert parameter.annotation not in (parameter.empty, "Any")
        assert f"{parameter.name}: " in text, parameter.name


def test_mistakes_are_python_s():
    with pytest.raises(TypeError, match="no_such_flag"):
        foxhunt.hunt(no_such_flag=3)
    for call in (
        lambda: foxhunt.run("hunt", no_such_flag=3),
        lambda: foxhunt.hunt(seed="many"),
        lambda: foxhunt.run("locate"),
    ):
        with pytest.raises(ValueError) as caught:
            call()
        assert "--help" not in str(caught.value) and "Usage" not in str(caught.value)
