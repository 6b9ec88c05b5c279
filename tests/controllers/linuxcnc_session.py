"""Drive a running LinuxCNC: home, make moves, and print where the joints are after each.

Run by the system's Python, which has the modules of LinuxCNC: `linuxcnc_session.py MODULE`, with
lines of G-code on stdin.
"""

import json
import sys
import time

WAIT = 30.0


def session(module):
    """Home, and make the moves that stdin names."""
    import hal
    import linuxcnc

    command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()

    def until(condition, what):
        end = time.monotonic() + WAIT
        status.poll()
        while not condition():
            if time.monotonic() > end:
                sys.exit(f"waited {WAIT} s for {what}; errors: {errors.poll()}")
            time.sleep(0.005)
            status.poll()

    def at_rest():
        return status.inpos and status.interp_state == linuxcnc.INTERP_IDLE

    component = hal.component("observer")  # without one no pin can be read
    component.ready()
    for state in (linuxcnc.STATE_ESTOP_RESET, linuxcnc.STATE_ON):
        command.state(state)
        command.wait_complete()
    until(lambda: status.task_state == linuxcnc.STATE_ON, "the machine to be on")
    command.home(-1)
    until(lambda: all(status.homed[: status.joints]), "homing")
    command.teleop_enable(1)
    command.wait_complete()
    command.mode(linuxcnc.MODE_MDI)
    command.wait_complete()
    for line in sys.stdin.read().splitlines():
        command.mdi(line)
        command.wait_complete(WAIT)
        until(at_rest, "a move to end")
        time.sleep(0.05)  # a servo cycle writes the pins after the status
        status.poll()
        said = errors.poll()
        found = {
            "joints": [hal.get_value(f"joint.{i}.pos-cmd") for i in range(status.joints)],
            "actual": list(status.actual_position[:6]),
            "failed": bool(hal.get_value(f"{module}.fwd-kins-fail")),
            "said": said and said[1],
        }
        print(json.dumps(found))


if __name__ == "__main__":
    session(sys.argv[1])
