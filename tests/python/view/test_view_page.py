"""Page of `o80 view`, in a real browser."""

import math
import os
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import o80
from chromium import Chromium, Page
from o80.view.page_file import write_page
from o80.view.serve import page_server

pytestmark = pytest.mark.check

SHOWN = "page.scene.frames > 0 && page.charts.length && page.charts[0].parts.observed"
COLOURS = """(() => {
  page.scene.dirty = true;
  page.scene.draw();
  const gl = page.scene.gl, [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
  const pixels = new Uint8Array(4 * w * h);
  gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  const found = new Set();
  for (let i = 0; i < pixels.length; i += 4) {
    found.add(`${pixels[i] >> 4} ${pixels[i + 1] >> 4} ${pixels[i + 2] >> 4}`);
  }
  return found.size;
})()"""
POSE = "Array.from(page.scene.pose)"


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    with Chromium() as started:
        yield started


@contextmanager
def page_of(
    browser: Chromium, *names: str | Path, control: bool = False, until: str = SHOWN, **how: Any
) -> Iterator[Page]:
    """A page of a server of its own, as soon as it shows what is there."""
    with page_server([*map(str, names)], control=control) as server:
        page = browser.page(server.url, **how)
        page.wait_for(until)
        yield page
        page.close()


def curve(part: str, what: str = "values", chart: int = 0) -> str:
    return f"Array.from(page.charts[{chart}].parts.{part}.{what})"


def scrub(page: Page, seconds: float) -> None:
    """Moves the slider as a user does."""
    page.value(
        f"(() => {{ const s = document.getElementById('slider'); s.value = {seconds};"
        f"s.dispatchEvent(new Event('input')); }})()"
    )


def click(page: Page, button: str) -> None:
    page.value(f"document.getElementById('{button}').click()")


def test_a_page_shows_the_robot_its_curves_and_its_state(browser: Chromium, segment: str) -> None:
    with o80.robots.load("two_joints").start(segment, frequency=200) as process:
        arm = process.frontend()
        arm.add_command("shoulder", 0.6, iterations=20)
        arm.pulse_and_wait(60.0)
        with page_server([segment]) as server:
            begin = time.monotonic()
            page = browser.page(server.url)
            page.wait_for("page.looks > 0")
            answered = time.monotonic() - begin
            page.wait_for("page.scene.frames > 0")
            print(f"answer after {answered:.2f} s, pose after {time.monotonic() - begin:.2f} s")
            page.wait_for(SHOWN)
            for text in (f"Halt {segment}", "of 200 Hz", "overruns", "observed 0.6 rad"):
                page.wait_for_text(text)
            assert page.value(COLOURS) > 20, "robot, floor and background"
            # the pose of the first body: turned about y by what the shoulder says
            page.wait_for(f"Math.abs({POSE}[5] - Math.sin(0.3)) < 1e-4")
            assert page.value(f"{curve('desired')}.at(-1)") == pytest.approx(0.6)
            assert page.value("document.getElementById('resume').hidden")
            page.close()
        arm.close()


def test_of_a_segment_that_is_waited_for_nothing_of_another_robot_is_shown(
    browser: Chromium, process: o80.robots.Process
) -> None:
    with page_of(browser, process.segment, "not-there") as page:
        looks = page.value("page.looks")
        page.value("document.getElementById('ghost-legend').hidden = false")
        page.value("page.choose('not-there')")
        page.wait_for(f"page.looks > {looks + 2}")
        shown = page.value("document.getElementById('robot').textContent")
        assert shown == "not-there"
        assert page.value("page.charts.length") == 0
        assert page.value("page.scene.geoms.length") == 0
        assert page.value("document.getElementById('ghost-legend').hidden")
        assert page.value("document.getElementById('time').textContent") == ""
        assert page.value("document.getElementById('halt').disabled")
        page.value(f"page.choose('{process.segment}')")
        page.wait_for(SHOWN)
        assert not page.value("document.getElementById('halt').disabled")


def test_the_halt_button_halts_and_the_resume_button_resumes(
    browser: Chromium, process: o80.robots.Process
) -> None:
    with process.frontend() as arm, page_of(browser, process.segment, control=True) as page:
        click(page, "halt")
        page.wait_for("!document.getElementById('resume').hidden")
        halt = arm.halted
        assert halt is not None
        assert halt.text == "from o80 view"
        page.wait_for_text("halted by pid")
        page.wait_for_text("Go on with Resume")
        click(page, "resume")
        page.wait_for("document.getElementById('resume').hidden")
        assert arm.halted is None


WORLD = """<mujoco><worldbody><geom type="plane" size="{0} {0} 1"/>
<geom name="table" type="box" pos="1 0 0.5" size="0.3 0.3 0.5" rgba="0 0 1 1"/>
<body name="base" pos="0 {1} 0.5"><joint name="turn" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 0.5" size="0.05"/></body></worldbody></mujoco>"""


def test_robots_of_one_world_stand_in_one_scene(browser: Chromium, segment: str) -> None:
    first, second, plain = f"{segment}-1", f"{segment}-2", f"{segment}-3"
    drawn = "page.scene.geoms.map((geom) => geom.shape).sort().join()"
    box = (
        "[...document.querySelectorAll('#segments .row')].find(r => r.innerText.includes('{0}'))"
        ".querySelector('.eye')"
    )
    with (
        o80.Backend(first, ["turn"], model=WORLD.format(2, 0), joints={"turn": "turn"}) as backend,
        o80.Backend(second, ["turn"], model=WORLD.format(3, 1), joints={"turn": "turn"}) as other,
        o80.Backend(plain, ["lift"]) as without_model,
        ExitStack() as stack,
    ):
        backend.publish([0.2])
        other.publish([-0.4])
        without_model.publish([0.0])
        # after the rows: a page opens on a robot that has one
        both = "page.scene.robots.size === 2"
        page = stack.enter_context(page_of(browser, first, second, plain, until=both))
        assert page.value(drawn) == "box,capsule,capsule,plane", "the table and a floor once"
        assert page.value("page.scene.geoms.find((geom) => geom.shape === 'plane').size[0]") == 3
        assert page.value(f"page.scene.robots.get('{second}').pose[5]") == pytest.approx(
            math.sin(-0.2)
        )
        assert not page.value(f"page.scene.robots.get('{second}').ghost")
        assert page.value(f"document.getElementById('halt').textContent === 'Halt {first}'")
        page.value(f"{box.format(first)}.click()")
        page.wait_for("page.scene.robots.size === 1")
        assert page.value(drawn) == "box,capsule,plane"
        bears = "document.getElementById('halt').textContent"
        chosen = page.value(f"(page.choose('{second}'), {bears})")
        assert chosen == f"Halt {second}", "at once, before any answer: it halts the chosen one"
        page.wait_for(f"{bears} === 'Halt {second}'")
        page.wait_for(f"page.scene.robots.get('{second}').ghost")
        assert page.value("page.scene.robots.size") == 1, "what was hidden stays so"
        page.value(f"{box.format(first)}.click()")
        page.wait_for("page.scene.robots.size === 2")
        page.value(f"page.choose('{plain}')")
        page.wait_for_text("so it is not drawn")
        assert page.value("page.scene.robots.size") == 2, "others are, and the page says so"


@pytest.mark.parametrize("dark", [False, True])
def test_on_a_phone_nothing_runs_out_and_the_halt_button_is_large(
    browser: Chromium, process: o80.robots.Process, dark: bool
) -> None:
    with page_of(browser, process.segment, control=True, width=420, height=860, dark=dark) as page:
        boxes = page.value(
            "Object.fromEntries([...document.querySelectorAll('[id]')].filter(e => e.offsetWidth)"
            ".map(e => [e.id, e.getBoundingClientRect().toJSON()]))"
        )
        assert page.value("document.documentElement.scrollWidth") <= 420
        for name, box in boxes.items():
            assert 0 <= box["left"] <= box["right"] <= 420, name
        assert boxes["halt"]["height"] >= 48
        assert boxes["halt"]["width"] >= 180
        assert boxes["scene"]["bottom"] <= boxes["charts"]["top"]
        assert "segments" not in boxes
        click(page, "list")
        assert page.value("document.getElementById('segments').offsetWidth") > 300
        assert page.value("document.getElementById('halt').offsetHeight") >= 48
        assert page.value(
            "(() => { const line = document.querySelector('#segments .segment');"
            "line.querySelector('b').textContent = '/path'.repeat(30);"
            "return line.scrollWidth <= line.clientWidth; })()"
        ), "a long name is broken"
        light = page.value("getComputedStyle(document.body).backgroundColor.match(/\\d+/)[0]")
        assert (int(light) < 64) == dark


def test_the_slider_goes_back_through_the_ring_and_live_returns(
    browser: Chromium, process: o80.robots.Process
) -> None:
    with process.frontend() as arm, page_of(browser, process.segment) as page:
        arm.add_command("elbow", 1.0, iterations=400)
        arm.pulse_and_wait(60.0)
        rows = arm.history()
        row = rows[len(rows) // 2]
        zero = page.value("page.answer.last") - 0.0
        assert zero > 0
        first = page.value("page.answer.first")
        scrub(page, first + (row.time - int(rows.time[0])) * 1e-9 + 1e-6)
        page.wait_for("page.timeline.at !== null && page.answer.last - page.answer.at > 0.01")
        shown = arm.history(since=page.value("page.answer.iteration"))[0]
        assert page.value("page.answer.values.elbow.observed") == shown.observed[1]
        page.wait_for_text("s ago")
        before = page.value("page.answer.last")
        page.wait_for(f"page.answer.last > {before}")  # the robot goes on
        assert page.value("page.answer.iteration") == shown.iteration
        click(page, "live")
        page.wait_for("page.answer.last === page.answer.at")


def test_a_page_that_stalled_shows_a_fresh_row_at_once(
    browser: Chromium, process: o80.robots.Process
) -> None:
    with process.frontend() as arm, page_of(browser, process.segment) as page:
        page.value(
            "(() => { page.shown = []; const show = page.show.bind(page);"
            "page.show = (answer) => { page.shown.push(answer.iteration); show(answer); }; })()"
        )
        os.killpg(browser.pid, signal.SIGSTOP)
        try:
            stalled = arm.published
            woken = arm.wait_for(stalled + 10_000, timeout=90.0).iteration  # 10 s, or longer
        finally:
            os.killpg(browser.pid, signal.SIGCONT)
        page.wait_for(f"page.answer.iteration > {woken}")
        old = [row for row in page.value("page.shown") if stalled < row <= woken]
        assert len(old) <= 1, "one answer may have been on its way, others show what is new"


def test_another_robot_that_takes_the_name_is_shown_anew(browser: Chromium, segment: str) -> None:
    with page_of(browser, segment, until="page.looks > 0") as page:
        page.wait_for_text("waiting")
        with o80.robots.load("two_joints").inline(segment):
            page.wait_for(SHOWN)
            assert page.value("page.scene.geoms.length") == 7
        page.wait_for_text("stopped")
        assert page.value("document.getElementById('halt').disabled")
        with o80.Backend(segment, actuators=["<b>lift</b>"]) as backend:
            backend.publish([2.5])
            page.wait_for("page.charts.length && page.charts[0].name.includes('lift')")
            page.wait_for_text("<b>lift</b>")  # names are text, never HTML
            page.wait_for_text("names no model")
            charts = "document.getElementById('charts').offsetWidth"
            assert page.value(f"{charts} > 0.6 * document.body.offsetWidth"), "the curves have it"
            assert page.value("page.scene.canvas.hidden")


def test_a_recording_is_played_and_scrubbed(browser: Chromium, segment: str, path: Path) -> None:
    with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(path, segment):
        arm.add_command("elbow", 1.0, iterations=2000)
        arm.burst(4000)
    with page_of(browser, path) as page:
        page.wait_for("page.answer.iteration > 0")
        assert page.value("document.getElementById('halt').disabled")
        page.wait_for_text("4001 rows")
        click(page, "play")
        page.wait_for("!page.timeline.playing")
        scrub(page, 1.0)
        page.wait_for("page.answer.iteration === 1000")
        assert page.value("page.answer.values.elbow.desired") == 0.5
        page.value(
            "document.getElementById('speed').value = '0.1'"
        )  # so that a slow computer sees it
        click(page, "play")
        page.wait_for("page.answer.iteration > 1100")
        click(page, "play")
        page.wait_for("!page.timeline.playing")
        assert page.value("page.answer.iteration") < 4000


def test_a_recording_in_a_file_needs_no_server_and_shows_the_same(
    browser: Chromium, segment: str, tmp_path: Path
) -> None:
    run, path = tmp_path / "run.mcap", tmp_path / "run.html"
    first, second = f"{segment}-1", f"{segment}-2"
    load = o80.robots.load("two_joints").inline
    with (
        load(first) as arm,
        load(second) as other,
        o80.Recording(run, [arm, other]) as recording,
    ):
        for robot in (arm, other):
            robot.add_command(["shoulder", "elbow"], [0.4, 1.0], iterations=2000)
            robot.burst(1000)
        recording.mark("<b>half</b>")
        with arm.chunks(step=100) as plan:
            plan.send([[0.2, 0.3], [0.1, 0.6], [0.3, 0.5]])
            for robot in (arm, other):
                robot.burst(2000)
    write_page([str(run)], path)
    rows = o80.open(run)[first].history()
    page = browser.page("about:blank")
    page.call("Network.enable")
    page.call(
        "Network.emulateNetworkConditions",
        offline=True,
        latency=0,
        downloadThroughput=0,
        uploadThroughput=0,
    )
    errors = """window.errors = []; console.error = (...each) => errors.push(each.join());
    addEventListener('error', (event) => errors.push(event.message));
    addEventListener('unhandledrejection', (event) => errors.push(String(event.reason)));
    addEventListener('securitypolicyviolation', (event) => errors.push(event.blockedURI));"""
    page.call("Page.addScriptToEvaluateOnNewDocument", source=errors)
    page.call("Page.navigate", url=path.as_uri())
    page.wait_for(SHOWN)
    click(page, "play")
    assert not page.value("document.getElementById('halt')")
    for seconds in (0.0, 0.7, 1.5, 2.9):
        scrub(page, seconds)
        page.wait_for(f"Math.abs(page.answer.at - {seconds}) < 0.02 && page.answer.curves")
        row = rows[int(page.value("page.answer.iteration"))]
        shoulder, elbow = (float(angle) for angle in row.observed)
        assert page.value("page.answer.at") == pytest.approx((row.time - rows.time[0]) * 1e-9)
        assert page.value("page.answer.values.elbow.observed") == pytest.approx(elbow, abs=1e-6)
        assert page.value(f"{POSE}[12]") == pytest.approx(
            math.sin((shoulder + elbow) / 2), abs=1e-6
        )
    # asked at once: not every answer has curves
    assert page.wait_for("page.answer.curves.marks.map((mark) => mark[1])") == ["<b>half</b>"]
    scrub(page, 1.2)
    page.wait_for("Math.abs(page.answer.at - 1.2) < 0.02 && (window.kept = page.answer.curves)")
    planned = page.value("kept.panels.elbow.planned.map((each) => Array.from(each))")
    ahead, values = (np.array(each, float)[:-1] for each in planned)
    assert ahead[-1] - ahead[0] == pytest.approx(0.3, abs=0.002)
    wanted = np.interp(
        ahead + page.value("kept.begin"), (rows.time - rows.time[0]) * 1e-9, rows.desired[:, 1]
    )
    np.testing.assert_allclose(values, wanted, atol=2e-3)
    page.value("document.querySelectorAll('#segments .eye')[1].click()")  # a copy of the first
    page.wait_for("page.scene.robots.size === 2")
    assert page.value("performance.getEntriesByType('resource').length") == 0
    assert page.value("window.errors") == []
    page.close()


def test_a_file_draws_plans_late_in_a_long_run(
    browser: Chromium, segment: str, tmp_path: Path
) -> None:
    run, path = tmp_path / "run.mcap", tmp_path / "run.html"
    with (
        o80.robots.load("two_joints").inline(segment, frequency=1) as arm,
        o80.Recording(run, arm),
        arm.chunks(step=1) as plan,
    ):
        arm.burst(3000)
        plan.send([[0.01, 0.02], [0.02, 0.03], [0.0, 0.0]])
        arm.burst(20)
    write_page([str(run)], path)
    page = browser.page(path.as_uri())
    page.wait_for(SHOWN)
    click(page, "play")
    scrub(page, 3002)
    ahead = page.wait_for(
        "Math.abs(page.answer.at - 3002) < 1 && page.answer.curves"
        " && Array.from(page.answer.curves.panels.elbow.planned[0])"
        ".map((seconds) => seconds + page.answer.curves.begin)"
    )
    assert ahead[:3] == pytest.approx([3001, 3002, 3003], abs=0.1)
    page.close()


def test_a_file_opens_on_the_robot_that_a_page_opens_on(
    browser: Chromium, segment: str, tmp_path: Path
) -> None:
    run, path = tmp_path / "run.mcap", tmp_path / "run.html"
    ball, arm = f"{segment}-1", f"{segment}-2"
    seen = {"ball": {"position": (float, 3)}}
    with (
        o80.Backend(ball, ["turn"], extended=seen, units={"position": "m"}) as tracker,
        o80.Backend(arm, ["turn"], model=WORLD.format(2, 0), joints={"turn": "turn"}) as backend,
    ):
        tracker.publish([0.0], {"ball": {"position": [1, 2, 3]}})
        backend.publish([0.2])
        with o80.Recording(run, [ball, arm]):
            pass
    write_page([str(run)], path)
    with page_server([str(run)]) as server:
        for url in (server.url, path.as_uri()):
            page = browser.page(url)
            page.wait_for("page.scene.frames > 0")
            assert page.value("page.source") == arm
            page.close()


def test_numbers_are_readable_and_have_their_unit(browser: Chromium, arm: o80.Frontend) -> None:
    with page_of(browser, arm.segment, until="page.looks > 0") as page:
        numbers = (
            "[[15710, 'Pa'], [0.5, 'rad'], [-0.00042, 'm'], [15710.4, ''], [0, 'm'],"
            "['nan', 'm'], [2e12, 'kg'], [1.5e-7, '']]"
        )
        assert page.value(f"{numbers}.map((each) => readable(...each))") == [
            *("15.71 kPa", "0.5 rad", "-420 \u00b5m", "15\u202f710", "0 m", "nan", "2e+12 kg"),
            "1.5e-7",
        ]
        head = (
            "(() => { const chart = new Chart('turn', 'rad or m'); chart.values({ observed: 0.5 });"
        )
        assert page.value(f"{head} return chart.head.textContent; }})()") == (
            "turn [rad or m]observed 0.5"
        )
        page.wait_for(SHOWN)
        drawn = page.value(
            "(() => { const texts = []; const fillText = (text, x, y) => texts.push([text, y]);"
            "const pen = new Proxy({ fillText }, { get: (own, name) => own[name] ?? (() => {}) });"
            "const chart = Object.assign(page.charts[0], { begin: 0, end: 0.002 });"
            "chart.axes(pen, { low: 0, high: 1, left: 46, bottom: 96, width: 346, length: 0.002,"
            "x: (seconds) => 46 + 150000 * seconds, y: (value) => 4 + 88 * (1 - value) });"
            "return texts; })()"
        )
        texts = [text for text, _ in drawn]
        assert {"0.5", "0.0005 s", "0.001 s", "0.0015 s"} <= set(texts)
        assert len(set(texts)) == len(texts), "each tick its own time"
        assert min(y for _, y in drawn) >= 8, "no number is cut off at the top"


def test_a_page_says_when_its_server_has_ended(browser: Chromium, arm: o80.Frontend) -> None:
    with page_server([arm.segment]) as server:
        page = browser.page(server.url)
        page.wait_for(SHOWN)
    page.wait_for_text("No answer")
    page.close()
