"""The modules of the safety path, and the component tests that guard each of them."""

from __future__ import annotations

REACTIVE_NODE = "interfaces/reactive_node/src/reactive_node"
_NODE_TESTS = "interfaces/reactive_node/tests"
_CHECKERS = (
    "tests/promises/test_findings.py",
    "tests/promises/test_bounds.py",
    "tests/promises/test_checkers.py",
)
_SAMPLES, _OPERATIONS, _RUNS = (
    f"{_NODE_TESTS}/test_signals_{name}.py" for name in ("samples", "operations", "runs")
)

GUARDS: dict[str, tuple[str, ...]] = {
    "services/operator_watchdog.py": (
        "tests/component/test_operator_watchdog.py",
        "tests/component/test_operator_watchdog_wiring.py",
        "tests/component/test_readme.py",
    ),
    "services/engine_controller.py": (
        "tests/component/test_engine_controller.py",
        "tests/component/test_engine_controller_wiring.py",
        "tests/component/test_engine_causes.py",
        "tests/component/test_readme.py",
    ),
    "interfaces/activity.py": (
        "tests/component/test_operator_watchdog.py",
        "tests/component/test_operator_watchdog_wiring.py",
    ),
    "interfaces/latch.py": (
        "tests/component/test_engine_controller.py",
        "tests/component/test_engine_causes.py",
    ),
    "interfaces/explanation.py": ("tests/component/test_engine_causes.py",),
    "interfaces/cause.py": ("tests/component/test_engine_causes.py",),
    "services/drive.py": ("tests/component/test_drive.py",),
    "services/dead_mans_switch.py": (
        "tests/component/test_dead_mans_switch.py",
        "tests/component/test_virtual_source.py",
        "tests/component/test_scenario.py",
        "tests/component/test_readme.py",
    ),
    "services/config_publisher.py": (
        "tests/component/test_config_publisher.py",
        "tests/component/test_virtual_source.py",
        "tests/component/test_drive.py",
        "tests/component/test_readme.py",
    ),
    "services/kinematics.py": (
        "tests/component/test_kinematics.py",
        "tests/component/test_effector_wiring.py",
    ),
    "services/velocity.py": (
        "tests/component/test_velocity.py",
        "tests/component/test_effector_wiring.py",
    ),
    "services/examples/speed_guard.py": (
        "tests/component/test_speed_guard.py",
        "tests/component/test_speed_guard_wiring.py",
    ),
    "services/examples/twist_gate.py": ("tests/component/test_twist_gate.py",),
    "services/examples/drive_adapter.py": ("tests/component/test_drive_adapter.py",),
    "services/examples/joint_source.py": (
        "tests/component/test_joint_source.py",
        "tests/component/test_simulated_time.py",
    ),
    "interfaces/drive_file.py": (
        "tests/component/test_drive_file.py",
        "tests/component/test_drive_adapter.py",
    ),
    "services/robot_state.py": ("tests/component/test_robot_state.py", "tests/component/test_readme.py"),
    "services/twist.py": ("tests/component/test_twist.py", "tests/component/test_readme.py"),
    "deploy/operator/hold.py": ("tests/operator/test_hold.py",),
    "deploy/operator/hand.py": (
        "tests/operator/test_terminal_commands.py",
        "tests/component/test_strangers.py",
    ),
    "deploy/operator/switch.py": (
        "tests/operator/test_switch.py",
        "tests/operator/test_terminal_commands.py",
        "tests/operator/page/test_operator_page.py",
    ),
    "deploy/operator/holder.py": ("tests/operator/test_holder.py",),
    "interfaces/sources/driving.py": (
        "tests/component/test_driving.py",
        "tests/component/test_drive.py",
    ),
    "deploy/supervision/reaction.py": (
        "tests/supervision/test_reaction.py",
        "tests/supervision/test_parameter_file.py",
    ),
    "interfaces/permission.py": (
        "tests/component/test_permission.py",
        "tests/component/test_twist_gate.py",
        "tests/component/test_drive.py",
    ),
    "interfaces/topics.py": (
        "tests/component/test_topics.py",
        "tests/component/test_readme.py",
        "tests/component/test_service_node.py",
        "tests/security/test_rights.py",
    ),
    "interfaces/service/clocks.py": (
        "tests/component/test_clocks.py",
        "tests/component/test_engine_controller_wiring.py",
        "tests/component/test_engine_causes.py",
        "tests/commands/test_hosts.py",
    ),
    "interfaces/service/health.py": (
        "tests/component/test_health.py",
        "tests/component/test_service_node.py",
        "tests/component/test_enclave.py",
        "tests/component/test_states.py",
    ),
    "interfaces/service/instance.py": ("tests/component/test_instance.py",),
    "interfaces/service/node.py": (
        "tests/component/test_service_node.py",
        "tests/component/test_health.py",
        "tests/component/test_peers.py",
        "tests/component/test_enclave.py",
    ),
    "interfaces/service/parameters.py": (
        "tests/component/test_readme.py",
        "tests/component/test_service_node.py",
        "tests/supervision/test_parameter_file.py",
    ),
    "interfaces/service/process.py": ("tests/component/test_service_life.py",),
    f"{REACTIVE_NODE}/scheduler.py": (f"{_NODE_TESTS}/test_scheduler.py",),
    f"{REACTIVE_NODE}/stamps.py": (f"{_NODE_TESTS}/test_stamps.py",),
    f"{REACTIVE_NODE}/node.py": tuple(
        f"{_NODE_TESTS}/test_{name}.py"
        for name in (
            "publishing",
            "observables",
            "message_reader",
            "sampled",
            "parameters",
            "events",
            "calls",
            "services",
            "actions",
            "end",
        )
    ),
    f"{REACTIVE_NODE}/end.py": (f"{_NODE_TESTS}/test_end.py",),
    f"{REACTIVE_NODE}/sampled_reader.py": (
        f"{_NODE_TESTS}/test_sampled.py",
        f"{_NODE_TESTS}/test_message_reader.py",
    ),
    f"{REACTIVE_NODE}/message_reader.py": (
        f"{_NODE_TESTS}/test_message_reader.py",
        f"{_NODE_TESTS}/test_observables.py",
    ),
    f"{REACTIVE_NODE}/shared_reader.py": (
        f"{_NODE_TESTS}/test_observables.py",
        f"{_NODE_TESTS}/test_sampled.py",
        f"{_NODE_TESTS}/test_events.py",
        f"{_NODE_TESTS}/test_end.py",
    ),
    f"{REACTIVE_NODE}/signals/samples.py": (_SAMPLES, _OPERATIONS, _RUNS),
    f"{REACTIVE_NODE}/signals/source.py": (_SAMPLES, _OPERATIONS, _RUNS),
    f"{REACTIVE_NODE}/signals/run.py": (_OPERATIONS, _RUNS),
    f"{REACTIVE_NODE}/signals/questions.py": (_OPERATIONS, _RUNS),
    f"{REACTIVE_NODE}/signals/signal.py": (_OPERATIONS, _SAMPLES),
    f"{REACTIVE_NODE}/signals/integral.py": (_OPERATIONS, _RUNS),
    f"{REACTIVE_NODE}/signals/replay.py": (_RUNS,),
    f"{REACTIVE_NODE}/signals/values.py": (_SAMPLES, _OPERATIONS),
    "deploy/supervision/policy.py": ("tests/supervision/test_policy.py",),
    "deploy/supervision/sentinel.py": (
        "tests/supervision/test_sentinel.py",
        "tests/supervision/test_sentinel_wiring.py",
        "tests/component/test_readme.py",
    ),
    "tests/promises/history.py": ("tests/promises/test_history.py", *_CHECKERS),
    "tests/promises/effects.py": ("tests/promises/test_effects.py", *_CHECKERS),
    "tests/promises/promises.py": ("tests/promises/test_checkers.py", "tests/promises/test_reports.py"),
    "tests/promises/claims.py": ("tests/promises/test_claims.py", *_CHECKERS),
    "tests/promises/safety.py": _CHECKERS,
    "tests/promises/drive.py": ("tests/promises/test_drive.py",),
    "tests/promises/liveness.py": _CHECKERS,
}
"""Paths of modules, and of the tests that run for each mutant of the module, quick ones first."""

_EXPERIMENT = "tests/simulation/test_experiment.py::test_"
SIMULATION = (
    f"{_EXPERIMENT}a_quiet_experiment_has_output_from_every_program",
    f"{_EXPERIMENT}the_promises_hold_in_the_scenarios_of_the_chaos_monkey",
    f"{_EXPERIMENT}the_promises_hold_under_each_kind_of_fault[kill]",
    f"{_EXPERIMENT}the_promises_hold_under_each_kind_of_fault[hang]",
    f"{_EXPERIMENT}a_bug_of_a_service_violates_a_promise",
)
"""Tests that run only for the mutants that survive component tests: the quickest part of the simulation."""
