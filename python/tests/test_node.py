"""Nodes as real processes, over a real bus, before a small sim."""

import tempfile
import unittest
from pathlib import Path

from small_sim import PATIENCE, SmallSim, message_observation, message_scene, message_taken

from reloop import messages

EXAMPLES = Path(__file__).parents[1] / "examples"

FAILS = """
import reloop

class Mine(reloop.Planner):
    def plan(self, step):
        if step.scene.id and step.number == 1:
            return self.recall()
        return [(20 + k, 0, 0, 10) for k in range(1, 51)]

    def recall(self):
        raise KeyError("no such thing")

reloop.serve(Mine)
"""

STANDS = """
import reloop

@reloop.planner
def plan(step):
    return [(step.av.x, step.av.y, step.av.heading, 0)] * 50

reloop.serve(plan)
"""

NAN = STANDS.replace("step.av.y,", "float('nan'),")
SLOW = "import time\n" + STANDS.replace("    return", "    time.sleep(0.7)\n    return")
TRAFFIC = """
import reloop

class Mine(reloop.Traffic):
    def start(self, scene):
        self.known = []

    def moves(self, step, taken):
        self.known += [agent.track for agent in taken if agent.since_step == step.number]
        if step.number == 2:
            raise LookupError(f"I know {self.known}")
        return [(a.state.x, float("nan") if step.number == 1 else 0, 0, 0, 0) for a in taken]

reloop.serve(Mine)
"""
NEEDS = "import reloop\nclass P(reloop.Planner):\n    needs_prediction = True\nreloop.serve(P)"


class NodeTest(unittest.TestCase):
    """One small sim and one node for each test."""

    def left(self, node):
        """How a node ended: exit code and standard error."""
        try:
            _, err = node.communicate(timeout=PATIENCE)
        finally:
            node.kill()
        return node.returncode, err

    def test_an_episode_is_planned_from_its_scene_to_its_end(self):
        with SmallSim() as sim:
            node = sim.start(EXAMPLES / "planner.py")
            role, worker, name, session, version = sim.admit()
            self.assertEqual((role, worker, name, version), ("planner", "w0", "mine", "3"))
            for episode in (4, 5):
                sim.tell(episode, scene=message_scene())
                for step in range(3):
                    sim.tell(episode, observation=message_observation(step))
                    key, answer = sim.answer()
                    self.assertEqual(key, f"plan/{session}")
                    self.assertEqual((answer.episode, answer.plan.step, answer.plan.error), (episode, step, ""))
                    self.assertEqual(len(answer.plan.states), 50)
                    # 10 m/s behind one of 5 m/s that is 40 m ahead: it goes on, and brakes.
                    self.assertAlmostEqual(answer.plan.states[0].x, 21.0 + step, delta=0.06)
                    self.assertLess(answer.plan.states[-1].speed, 9.0)
                    self.assertLess(answer.plan.states[-1].x, 60.0 + 25.0)
                sim.tell(episode, end=messages.EpisodeEnd(scene="straight"))
                key, answer = sim.answer()
                self.assertEqual((answer.episode, answer.WhichOneof("what")), (episode, "done"))
            sim.leave()
            self.assertEqual(self.left(node), (0, ""))

    def test_a_predictor_says_where_everybody_goes_on_to(self):
        with SmallSim() as sim:
            node = sim.start(EXAMPLES / "predictor.py")
            role, _, _, session, _ = sim.admit()
            self.assertEqual(role, "predictor")
            sim.tell(1, scene=message_scene())
            sim.tell(1, observation=message_observation(0))
            key, answer = sim.answer()
            self.assertEqual(key, f"prediction/{session}")
            (future,) = answer.prediction.futures
            (car,) = future.trajectories
            self.assertEqual((car.track, future.probability, len(car.x)), (5, 1.0, 50))
            self.assertAlmostEqual(car.x[49], 60.0 + 5.0 * 5.0)
            sim.leave()
            self.assertEqual(self.left(node), (0, ""))

    def test_traffic_says_where_everybody_is_who_is_taken_over(self):
        with SmallSim() as sim:
            node = sim.start(EXAMPLES / "traffic.py")
            role, _, _, session, _ = sim.admit()
            self.assertEqual(role, "traffic")
            sim.tell(1, scene=message_scene())
            for step in range(3):
                sim.tell(1, observation=message_observation(step))
                # Nobody at first, then the car, whose way is told once.
                sim.tell(1, taken=message_taken(step, since=1) if step else messages.TakenAgents(step=0))
                key, answer = sim.answer()
                self.assertEqual(key, f"moves/{session}")
                self.assertEqual((answer.episode, answer.moves.step, answer.moves.error), (1, step, ""))
                self.assertEqual([agent.track for agent in answer.moves.agents], [5] if step else [])
            (car,) = answer.moves.agents
            self.assertAlmostEqual(car.state.x, 61.0 + 0.5, delta=0.02)
            self.assertEqual((car.state.y, car.state.length, car.state.height), (0.0, 4.0, 1.5))
            self.assertAlmostEqual(car.state.z, 0.75 + 0.01, delta=1e-3)  # uphill with its way
            sim.tell(1, end=messages.EpisodeEnd(scene="straight"))
            key, answer = sim.answer()
            self.assertEqual((key, answer.WhichOneof("what")), (f"moves/{session}", "done"))
            sim.leave()
            self.assertEqual(self.left(node), (0, ""))

    def test_traffic_that_cannot_answer_says_why(self):
        with SmallSim() as sim:
            node = sim.start(TRAFFIC)
            sim.admit()
            for episode, steps, said in (
                (1, (0, 1), "AnswerError: the states, row 0: y is nan"),
                (2, (0, 2), "LookupError: I know [5] (<string>:11)"),
                (3, (1,), "it cannot be read who is taken over: agents[0].way is missing: none was told of track 5"),
            ):
                sim.tell(episode, scene=message_scene())
                for step in steps:
                    sim.tell(episode, observation=message_observation(step))
                    sim.tell(episode, taken=message_taken(step))
                    told = sim.answer()[1].moves
                self.assertEqual((told.step, told.error), (steps[-1], said))
            sim.leave()
            self.assertEqual(self.left(node)[0], 0)

    def test_a_torch_predictor_says_that_it_needs_torch(self):
        try:
            import torch  # noqa: F401
        except ImportError:
            with SmallSim() as sim:
                code, err = self.left(sim.start(EXAMPLES / "torch_predictor.py"))
                self.assertEqual((code, err), (1, "error: this predictor needs torch\n  hint: pip install torch\n"))
            return
        with SmallSim() as sim:
            node = sim.start(EXAMPLES / "torch_predictor.py")
            sim.admit()
            sim.tell(1, scene=message_scene())
            sim.tell(1, observation=message_observation(0))
            _, answer = sim.answer()
            self.assertEqual((answer.prediction.error, len(answer.prediction.futures)), ("", 3))
            self.assertAlmostEqual(sum(future.probability for future in answer.prediction.futures), 1.0)
            sim.leave()
            self.assertEqual(self.left(node)[0], 0)

    def test_an_exception_is_told_and_the_next_episode_is_planned(self):
        with SmallSim() as sim:
            node = sim.start(FAILS)
            sim.admit()
            errors = []
            for episode, steps in ((1, 3), (2, 1)):
                sim.tell(episode, scene=message_scene())
                for step in range(steps):
                    sim.tell(episode, observation=message_observation(step))
                    errors.append(sim.answer()[1].plan.error)
            told = "KeyError: 'no such thing' (<string>:11)"
            self.assertEqual(errors, ["", told, told, ""])
            sim.leave()
            code, err = self.left(node)
            self.assertEqual(code, 0)
            self.assertIn(f"straight step 1: {told}\n  <string>:7 in plan: \n  <string>:11 in recall: \n", err)
            self.assertNotIn("desk.py", err)

    def test_a_plan_with_a_nan_is_refused_by_its_place(self):
        with SmallSim() as sim:
            node = sim.start(NAN)
            sim.admit()
            sim.tell(1, scene=message_scene())
            sim.tell(1, observation=message_observation(0))
            self.assertEqual(sim.answer()[1].plan.error, "AnswerError: the states, row 0: y is nan")
            node.kill()
            self.left(node)

    def test_a_slow_plan_is_told_of_in_the_log(self):
        with SmallSim() as sim:
            node = sim.start(SLOW)
            sim.admit()
            sim.tell(1, scene=message_scene())
            sim.tell(1, observation=message_observation(0))
            self.assertEqual(sim.answer()[1].plan.error, "")
            sim.leave()
            self.assertRegex(self.left(node)[1], r"step 0 took 0\.\d s; the sim waits 0\.5 s")

    def test_who_comes_late_asks_for_the_scene(self):
        with SmallSim() as sim:
            sim.scene_document = message_scene().SerializeToString()
            node = sim.start(STANDS)
            sim.admit()
            sim.tell(9, observation=message_observation(1))
            _, answer = sim.answer()
            self.assertEqual((answer.episode, answer.plan.step, answer.plan.error), (9, 1, ""))
            self.assertEqual(answer.plan.states[49].x, 21.0)
            sim.leave()
            self.assertEqual(self.left(node)[0], 0)

    def test_a_scene_that_nobody_has_is_an_honest_refusal(self):
        with SmallSim() as sim:
            node = sim.start(STANDS)
            sim.admit()
            sim.tell(9, observation=message_observation(1))
            self.assertEqual(sim.answer()[1].plan.error, "its scene never came")
            node.kill()
            self.left(node)

    def test_who_is_refused_leaves_and_says_why(self):
        with SmallSim() as sim:
            node = sim.start(STANDS)
            sim.admit(accepted=False, reason="planner other sits there")
            expected = (
                "error: planner mine (worker w0) is refused: planner other sits there\n"
                "  hint: whoever runs the sim decides it; its log says the same\n"
            )
            self.assertEqual(self.left(node), (2, expected))

    def test_a_sim_of_another_version_is_refused_with_both(self):
        with SmallSim(version=2) as sim:
            code, err = self.left(sim.start(STANDS))
            self.assertEqual(code, 2)
            self.assertIn("the sim speaks version 2 of the messages, this package version 3", err)

    def test_a_wrong_secret_no_sim_no_run_and_no_endpoint_are_told_apart(self):
        with SmallSim() as sim:
            # Together, for each waits for a while before it gives up.
            nodes = {
                "nobody said where the sim is (--endpoint)\n  hint: let the sim start": {"RELOOP_ENDPOINT": None},
                "cannot reach a sim at tcp/127.0.0.1:9": {"RELOOP_ENDPOINT": "tcp/127.0.0.1:9"},
                "no run other at tcp/127.0.0.1": {"RELOOP_RUN": "other"},
                "run small has not let this planner in within 10 s\n  hint: RELOOP_SECRET": {"RELOOP_SECRET": "wrong"},
            }
            started = {said: sim.start(STANDS, **environment) for said, environment in nodes.items()}
            for said, node in started.items():
                code, err = self.left(node)
                self.assertEqual(code, 2)
                self.assertIn(f"error: {said}", err)

    def test_a_zenoh_configuration_that_cannot_be_used_is_named_and_no_value_of_it_shown(self):
        faults = {
            "{ transport: { link: { tls: { enable_mtls: 's3cret' } } } }": "invalid type",
            "{ transport: { link: { tls: { root_ca: 's3cret' } } } }": "unknown field `root_ca`",
            "{ transport: { link: { tls: { connect_certificate: 'none.pem' } } } }": "connect_certificate: there is no",
        }
        with SmallSim() as sim, tempfile.TemporaryDirectory() as folder:
            for text, said in faults.items():
                file = Path(folder, "mine.json5")
                file.write_text(text)
                code, err = self.left(sim.start(STANDS, "--zenoh-config", str(file)))
                self.assertEqual(code, 2)
                self.assertIn(f"error: {file}: ", err)
                self.assertIn(said, err)
                self.assertNotIn("s3cret", err)

    def test_a_planner_that_needs_predictions_leaves_a_run_without(self):
        with SmallSim() as sim:
            code, err = self.left(sim.start(NEEDS))
            self.assertEqual(code, 2)
            self.assertIn("this planner needs a predictor, and run small has none", err)

    def test_it_leaves_with_who_started_it(self):
        with SmallSim() as sim:
            node = sim.start(STANDS, "--exit-with-parent")
            sim.admit()
            node.stdin.close()
            node.stdin = None
            self.assertEqual(self.left(node), (0, ""))


if __name__ == "__main__":
    unittest.main()
