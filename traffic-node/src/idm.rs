//! The intelligent driver model of Treiber, Hennecke and Helbing, "Congested traffic states in empirical observations and microscopic
//! simulations", 2000, with the parameters that others drive it with.

/// Treiber's exponent is 4 here, as in nuPlan and Waymax.
fn fourth(ratio: f64) -> f64 {
    (ratio * ratio) * (ratio * ratio)
}

/// Its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Idm {
    /// Speed that is aimed at where no lane says how fast (m/s).
    pub desired_speed: f64,
    /// Gap at standstill (m).
    pub standstill_gap: f64,
    /// Time headway to the leader (s).
    pub headway: f64,
    /// Acceleration on a free road from standstill (m/s^2).
    pub acceleration: f64,
    /// Comfortable deceleration (m/s^2).
    pub deceleration: f64,
}

/// No vehicle brakes harder (m/s^2): dry asphalt gives 7 to 8.
pub const HARDEST_BRAKING: f64 = 7.5;

/// Gaps below this (m) are all the same.
const LEAST_GAP: f64 = 0.1;

/// Who is so near to a line (m) is there.
const AT_THE_LINE: f64 = 0.3;

/// Towards a line one brakes evenly, by this share of what is comfortable.
const EVENLY: f64 = 0.6;

/// What one is too fast for the road goes in this time (s).
const SETTLING: f64 = 1.0;

impl Idm {
    /// nuPlan's reactive agents: `idm_agents_observation.yaml` of nuplan-devkit (target_velocity 10, min_gap_to_lead_agent 1.0, headway_time
    /// 1.5, accel_max 1.0, decel_max 2.0).
    pub const NUPLAN: Self =
        Self { desired_speed: 10.0, standstill_gap: 1.0, headway: 1.5, acceleration: 1.0, deceleration: 2.0 };

    /// Waymax's: `IDMRoutePolicy` in `waymax/agents/waypoint_following_agent.py` (desired_vel 30, min_spacing 2, safe_time_headway 2, max_accel
    /// 2, max_decel 4).
    pub const WAYMAX: Self =
        Self { desired_speed: 30.0, standstill_gap: 2.0, headway: 2.0, acceleration: 2.0, deceleration: 4.0 };

    /// The acceleration (m/s^2) at `speed` on a free road where `desired` is wanted. Treiber's term knows a desired speed that stays: what is
    /// too fast where it falls goes within a second, no harder than is comfortable.
    #[must_use]
    pub fn free(&self, speed: f64, desired: f64) -> f64 {
        let desired = desired.max(0.1);
        if speed <= desired {
            return self.acceleration * (1.0 - fourth(speed / desired));
        }
        ((desired - speed) / SETTLING).max(-self.deceleration)
    }

    /// The acceleration (m/s^2) behind somebody who is `gap` (m) ahead and goes at `leader` (m/s).
    #[must_use]
    pub fn behind(&self, speed: f64, gap: f64, leader: f64) -> f64 {
        let approach = speed * (speed - leader) / (2.0 * (self.acceleration * self.deceleration).sqrt());
        let wanted = self.standstill_gap + (speed * self.headway + approach).max(0.0);
        let ratio = wanted / gap.max(LEAST_GAP);
        (self.acceleration * (1.0 - ratio * ratio)).max(-HARDEST_BRAKING)
    }

    /// The acceleration (m/s^2) towards a line `distance` (m) ahead at which one comes to stand: evenly, from where that is comfortable.
    #[must_use]
    pub fn before_a_line(&self, speed: f64, distance: f64) -> f64 {
        if distance < AT_THE_LINE {
            return (-0.5 - 3.0 * speed).max(-HARDEST_BRAKING);
        }
        let even = EVENLY * self.deceleration;
        let needed = speed * speed / (2.0 * distance);
        if needed >= even {
            return (-1.05 * needed).max(-HARDEST_BRAKING);
        }
        // Not yet: up to the speed from which braking evenly is due.
        let due = ((2.0 * even * distance).sqrt() - speed) / SETTLING;
        due.min(self.acceleration * (1.0 - needed / even))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn on_a_free_road_it_speeds_up_to_what_is_desired_and_no_further() {
        let mut speed = 0.0;
        for _ in 0..1500 {
            speed += 0.1 * Idm::NUPLAN.free(speed, 10.0);
        }
        assert!((speed - 10.0).abs() < 0.1, "{speed}");
        assert!(Idm::NUPLAN.free(12.0, 10.0) < 0.0);
    }

    #[test]
    fn the_equilibrium_gap_is_treibers() {
        // s_e = s0 + vT where the road term is nil: far below the desired speed, equation 5 of the paper of 2000.
        for idm in [Idm::NUPLAN, Idm::WAYMAX] {
            let gap = idm.standstill_gap + 8.0 * idm.headway;
            assert!(idm.behind(8.0, gap, 8.0).abs() < 1e-12);
        }
    }

    #[test]
    fn it_stops_behind_a_wall_and_before_a_line() {
        let stop = |law: fn(f64, f64) -> f64| {
            let (mut gap, mut speed) = (60.0, 14.0);
            for _ in 0..600 {
                speed = (speed + 0.1 * law(speed, gap)).max(0.0);
                gap -= 0.1 * speed;
            }
            (gap, speed)
        };
        let (gap, speed) = stop(|speed, gap| Idm::NUPLAN.behind(speed, gap, 0.0));
        assert!((0.5..2.0).contains(&gap) && speed < 0.1, "gap {gap}, speed {speed}");
        let (gap, speed) = stop(|speed, gap| Idm::NUPLAN.before_a_line(speed, gap));
        assert!((0.0..0.5).contains(&gap) && speed < 0.2, "gap {gap}, speed {speed}");
    }
}
