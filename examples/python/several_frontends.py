"""Command one arm from two frontends; a third one, in another process, logs every row."""

import multiprocessing

import o80


def log(segment: str, rows: int, ready: "multiprocessing.synchronize.Event", report: str) -> None:
    """Reads `rows` rows in order and reports the number of missed ones."""
    missed = 0
    with o80.Frontend(segment, read_only=True) as reader, open(report, "w") as out:
        ready.set()
        for _ in range(rows):
            observation = reader.wait_for_next(timeout=10.0)
            missed += observation.missed
            out.write(f"{observation.iteration} {observation.observed.tolist()}\n")
    print(f"the logger wrote {rows} rows and missed {missed}")


def main(report: str = "/dev/null") -> None:
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    with o80.robots.load("two_joints").start(frequency=500) as process:
        logger = context.Process(target=log, args=(process.segment, 200, ready, report))
        logger.start()
        ready.wait(30.0)

        with o80.Frontend(process.segment) as upper, o80.Frontend(process.segment) as lower:
            upper.add_command("shoulder", 0.4, duration=0.2)
            lower.add_command("elbow", -0.4, duration=0.2)
            first, second = upper.pulse(), lower.pulse()
            first.wait(10.0)
            second.wait(10.0)
            print(f"both ended: {first.statuses[0].name}, {second.statuses[0].name}")

            # exclusive control keeps other frontends out for a while
            with upper.control():
                lower.add_command("elbow", 0.0)
                refused = lower.pulse()
                try:
                    refused.wait(10.0)
                except o80.NotCompleted as error:
                    print(f"without control: {error.ends[0].status.name}")
        logger.join()


if __name__ == "__main__":
    main()
