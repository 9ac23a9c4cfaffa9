"""A service is asked from Python. ``RELOOP_SERVICE`` and ``RELOOP_SECRET`` say which; it offers the set ``small``."""

import os
import unittest

import pandas

import reloop
from reloop import messages
from reloop.settings import settings


class SettingsTest(unittest.TestCase):
    def test_settings_are_those_of_sim_run(self):
        made = settings(driver="idm", set=["horizon=9"], scenes="small", in_process=True)
        self.assertEqual((made.driver, list(made.set), list(made.scenes)), ("idm", ["horizon=9"], ["small"]))
        made = settings(traffic="mixed", traffic_seed=0, traffic_set="radius=80")
        self.assertEqual(
            (made.traffic, made.HasField("traffic_seed"), list(made.traffic_set)), ("mixed", True, ["radius=80"])
        )
        with self.assertRaisesRegex(TypeError, "'out' is no setting; there are driver"):
            settings(out="/tmp/x")

    def test_a_secret_that_is_no_key_is_not_shown(self):
        with self.assertRaisesRegex(reloop.NodeError, r"secret \*\*\*"):
            reloop.Service("tcp/127.0.0.1:1", secret="sword/fish")

    def test_a_question_is_a_message(self):
        ask = messages.service("Ask")(step=messages.service("Step")(session="s", steps=3))
        self.assertEqual(messages.service("Ask").FromString(ask.SerializeToString()), ask)


@unittest.skipUnless(os.environ.get("RELOOP_SERVICE"), "no RELOOP_SERVICE")
class ServiceTest(unittest.TestCase):
    def setUp(self):
        self.service = reloop.Service()
        self.addCleanup(self.service.close)

    def test_a_run_is_submitted_watched_and_read(self):
        offer = self.service.offer()
        self.assertEqual((len(offer.sets["small"]), "idm" in offer.drivers), (3, True))
        run = self.service.submit("idm", sets=["small"], name="python", record="none", in_process=True)
        self.assertEqual(run, self.service.submit("idm", sets="small", name="python", record="none", in_process=True))
        ends = list(self.service.watch("python"))
        self.assertEqual({end.scene for end in ends}, set(offer.sets["small"]))
        self.assertTrue(all(end.steps > 0 and not end.failed for end in ends))
        run = self.service.wait("python")
        self.assertEqual((run.state, run.done, run.failed, run.is_over), ("done", 3, 0, True))
        self.assertIn(run, self.service.status())
        frame = self.service.table("python")
        self.assertIsInstance(frame, pandas.DataFrame)
        self.assertEqual((set(frame["scene"]), frame.attrs["units"]["progress_m"]), (set(offer.sets["small"]), "m"))
        self.assertIn("idm", self.service.table("python", format="csv"))

    def test_agents_of_a_run_react(self):
        self.service.submit(
            "constant-velocity",
            sets=["small"],
            name="reactive",
            record="none",
            in_process=True,
            traffic="mixed",
            traffic_seed=3,
        )
        self.service.wait("reactive")
        frame = self.service.table("reactive")
        self.assertEqual(set(frame["traffic"]), {"mixed"})
        self.assertGreater(frame["reactive_agent_steps"].sum(), 50)

    def test_a_run_is_cancelled(self):
        self.service.submit("idm", name="long")
        self.service.cancel("long")
        self.assertEqual(self.service.status("long").state, "cancelled")
        self.assertEqual(self.service.wait("long").state, "cancelled")

    def test_what_is_refused_says_why(self):
        with self.assertRaisesRegex(reloop.ServiceError, "starts no programs"):
            self.service.submit(planner_command="true")
        with self.assertRaisesRegex(reloop.ServiceError, "starts no programs of its clients: traffic-command"):
            self.service.submit("idm", traffic_command="true")
        with self.assertRaisesRegex(reloop.ServiceError, "agents of a session are replayed"):
            self.service.open("demo-curve", "idm", traffic="idm")
        with self.assertRaisesRegex(reloop.ServiceError, "there is no run"):
            list(self.service.watch("nothing"))
        with self.assertRaisesRegex(reloop.ServiceError, 'no scene set "none" is offered'):
            self.service.open("x", "idm", sets=["none"])

    def test_a_session_is_stepped_forked_and_driven_to_its_end(self):
        scene = self.service.offer().sets["small"][0]
        with self.service.open(scene, "idm", sets=["small"], in_process=True) as session:
            self.assertEqual((session.number, session.scene.id, session.driver), (0, scene, "idm"))
            self.assertEqual(session.step(5).number, 5)
            self.assertEqual((len(session.records), session.plan.step), (5, 4))
            before = session.av
            self.assertEqual((session.look().av.x, len(session.records)), (before.x, 5))
            self.assertEqual(len(session.agents.x), len(session.agents))
            with session.fork(3, "constant-velocity", in_process=True) as other:
                self.assertEqual(other.number, 3)
                other.run()
                self.assertTrue(other.is_over)
            session.run()
            self.assertIsNone(session.av)
            self.assertGreater(session.metrics["progress_m"], 1)
            self.assertEqual(session.end.steps, len(session.records))
        with self.assertRaisesRegex(reloop.ServiceError, "there is no session"):
            session.look()


if __name__ == "__main__":
    unittest.main()
