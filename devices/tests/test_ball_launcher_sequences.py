"""Whatever happens in whatever order: never two launches, never a late one."""

import contextlib

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from launcher_bench import Bench

from o80 import RequestRejected
from o80_devices.ball_launcher.launcher import SECOND, LastLaunch, Status, Timing
from o80_devices.ball_launcher.messages import Kind, State
from o80_devices.fakes.ball_launcher import Behaviour

EVENTS = ("ask", "step", "serve", "both", "wait", "long", "die", "bind", "restart", "move", "ready")
TIMING = Timing(deliver=SECOND // 2, state=5 * SECOND, launch=10 * SECOND, retry=SECOND)


class Judge:
    """Plays events, and looks at every launch that begins and every launch that arrives."""

    def __init__(self) -> None:
        self.bench = Bench(Behaviour(state_time=0.1, launch_time=2.0, magazine=2), TIMING)
        self.bench.before_launch = self.launch_begins
        self.begun_before = self.received_before = 0  # before the launcher died the last time
        self.timed_out_at: int | None = None
        self.may_arrive = 0  # launches that were asked for and not reported as not sent

    def launch_begins(self) -> None:
        bench = self.bench
        sent = sum(exchange.sent for _, exchange in bench.launches_begun[self.begun_before :])
        received = bench.received - self.received_before
        assert sent <= received, "an older launch is still on its way"
        busy = bench.fake.busy
        assert busy is None or busy.kind is not Kind.LAUNCH_BALL, "two launches overlap"
        if self.timed_out_at is not None:
            assert bench.now >= self.timed_out_at + TIMING.launch, "the launcher is unknown"

    def look(self) -> None:
        bench = self.bench
        if (end := bench.client.ended()) is not None:
            if end[0] is LastLaunch.timed_out:
                self.timed_out_at = bench.now
            self.may_arrive -= end[0] is LastLaunch.not_sent
        assert bench.received <= self.may_arrive, "a launch arrives that was reported as not sent"

    def play(self, event: str) -> None:
        bench = self.bench
        if event == "ask":
            with contextlib.suppress(RequestRejected):
                bench.client.ask(bench.now)
                self.may_arrive += 1
        elif event == "wait":
            bench.now += SECOND
        elif event == "long":
            bench.now += 12 * SECOND
        elif event == "die":
            bench.fake.die()
            self.begun_before, self.received_before = len(bench.launches_begun), bench.received
        elif event == "bind" and not bench.fake.alive:
            bench.fake.bind(bench.address)
        elif event == "restart":  # of the driver; what it had sent is nobody's any more
            bench.stop_client()
            bench.connect()
            self.timed_out_at = None
        elif event == "move":
            bench.wanted = State(1.0 - bench.wanted.phi / 2)
        elif event == "ready":
            self.until_ready()
        if event in ("step", "both"):
            bench.step()
        if event in ("serve", "both"):
            bench.serve()
        self.look()

    def until_ready(self) -> None:
        """Whatever happened, it comes back."""
        if not self.bench.fake.alive:
            self.bench.fake.bind(self.bench.address)

        def ready() -> bool:
            self.look()
            return self.bench.status is Status.ready

        self.bench.until(ready, SECOND // 20)


@settings(
    max_examples=40,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    phases=(Phase.explicit, Phase.reuse, Phase.generate),  # shrinking would take minutes
)
@given(st.lists(st.sampled_from(EVENTS), max_size=60))
def test_launches_never_overlap_and_are_never_late(events: list[str]) -> None:
    judge = Judge()
    try:
        for event in ["ready", "ask", *events]:
            judge.play(event)
        judge.until_ready()
    finally:
        judge.bench.close()
