//! What is measured: each quantity with its section, its words, its unit, and how many decimals say something.

use std::fmt;

/// A part of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the words are in the table")]
pub enum Section {
    Agents,
    Sizes,
    Parked,
    Speeds,
    Gaps,
    Av,
    Lanes,
    Signals,
    Areas,
}

impl Section {
    /// All of them, in the table's order.
    pub const ALL: [Self; 9] = [
        Self::Agents,
        Self::Sizes,
        Self::Parked,
        Self::Speeds,
        Self::Gaps,
        Self::Av,
        Self::Lanes,
        Self::Signals,
        Self::Areas,
    ];
}

impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Agents => "Agents",
            Self::Sizes => "Sizes (median over each track)",
            Self::Parked => "Parked vehicles",
            Self::Speeds => "Speeds and accelerations",
            Self::Gaps => "Gaps and headways on the same lane",
            Self::Av => "The AV",
            Self::Lanes => "Lanes",
            Self::Signals => "Signals",
            Self::Areas => "Crosswalks and others",
        })
    }
}

/// Declares an enum of things that are measured, and what is said of each: section, words, unit, decimals.
macro_rules! measured {
    ($(#[$doc:meta])* $name:ident { $($section:ident { $($variant:ident: $words:literal, $unit:literal, $decimals:literal;)* })* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[allow(missing_docs, reason = "the words are beside them")]
        pub enum $name { $($($variant,)*)* }

        impl $name {
            /// All of them, in the table's order.
            pub const ALL: &'static [Self] = &[$($(Self::$variant,)*)*];

            const fn said(self) -> (Section, &'static str, &'static str, usize) {
                match self { $($(Self::$variant => (Section::$section, $words, $unit, $decimals),)*)* }
            }

            /// The part of the table that it is in.
            #[must_use]
            pub const fn section(self) -> Section {
                self.said().0
            }

            /// What it is called, without its unit.
            #[must_use]
            pub const fn words(self) -> &'static str {
                self.said().1
            }

            /// Its unit; empty for counts and shares.
            #[must_use]
            pub const fn unit(self) -> &'static str {
                self.said().2
            }

            /// Digits after the point that are worth printing.
            #[must_use]
            pub const fn decimals(self) -> usize {
                self.said().3
            }
        }
    };
}

measured! {
    /// Something whose values are spread: told by percentiles.
    Quantity {
        Agents {
            Vehicles: "vehicles per scene (tracks, AV included)", "", 0;
            Pedestrians: "pedestrians per scene", "", 0;
            Cyclists: "cyclists per scene", "", 0;
            Tracks: "tracks per scene", "", 0;
            TracksValid: "tracks valid at one step", "", 0;
            VehiclesWithin50: "vehicles within 50 m of the AV", "", 0;
            MovingWithin50: "moving vehicles within 50 m", "", 0;
            PedestriansWithin50: "pedestrians within 50 m", "", 0;
            CyclistsWithin50: "cyclists within 50 m", "", 0;
            VehiclesWithin100: "vehicles within 100 m", "", 0;
            ShareValid: "share of steps in which a track is valid", "", 2;
        }
        Sizes {
            VehicleLength: "vehicle length", "m", 2;
            VehicleWidth: "vehicle width", "m", 2;
            VehicleHeight: "vehicle height", "m", 2;
            PedestrianLength: "pedestrian length", "m", 2;
            PedestrianWidth: "pedestrian width", "m", 2;
            PedestrianHeight: "pedestrian height", "m", 2;
            CyclistLength: "cyclist length", "m", 2;
            CyclistWidth: "cyclist width", "m", 2;
            CyclistHeight: "cyclist height", "m", 2;
        }
        Parked {
            ParkedToLane: "distance of a non-moving vehicle to the nearest lane centre", "m", 2;
            MovingToLane: "same for a moving vehicle (its first state)", "m", 2;
        }
        Speeds {
            VehicleSpeed: "moving vehicle speed", "m/s", 2;
            PedestrianSpeed: "moving pedestrian speed", "m/s", 2;
            CyclistSpeed: "moving cyclist speed", "m/s", 2;
            VehicleAcceleration: "moving vehicle longitudinal acceleration (0.5 s difference of 0.3 s mean; outliers over 10 removed)", "m/s^2", 2;
        }
        Gaps {
            GapBothMoving: "gap, both faster than 2 m/s, gap < 60 m", "m", 2;
            HeadwayBothMoving: "headway, same cases", "s", 2;
            Gap: "gap, follower faster than 2 m/s", "m", 2;
            Headway: "headway, follower faster than 2 m/s", "s", 2;
            Gap2To5: "gap at 2-5 m/s", "m", 2;
            Gap5To10: "gap at 5-10 m/s", "m", 2;
            Gap10To15: "gap at 10-15 m/s", "m", 2;
            GapOver15: "gap over 15 m/s", "m", 2;
            Headway2To5: "headway at 2-5 m/s", "s", 2;
            Headway5To10: "headway at 5-10 m/s", "s", 2;
            Headway10To15: "headway at 10-15 m/s", "s", 2;
            HeadwayOver15: "headway over 15 m/s", "s", 2;
            QueueGap: "gap in a standing queue (both below 0.5 m/s)", "m", 2;
            AvGap: "AV gap to its leader (AV faster than 2 m/s)", "m", 2;
            AvHeadway: "AV headway", "s", 2;
        }
        Av {
            AvPath: "path length in the scene", "m", 1;
            AvMaxSpeed: "maximum speed", "m/s", 2;
            AvSpeed: "speed (over steps)", "m/s", 2;
            AvStanding: "share of steps standing (< 0.3 m/s), per scene", "", 2;
            AvAcceleration: "longitudinal acceleration, smooth (0.5 s mean, 1 s difference)", "m/s^2", 2;
            AvLateralAcceleration: "lateral acceleration as speed x yaw rate (0.5 s mean), absolute", "m/s^2", 2;
            AvStepAcceleration: "acc, per step", "m/s^2", 2;
            AvStepJerk: "jerk, per step", "m/s^3", 2;
            AvStepLateral: "lateral acc, per step", "m/s^2", 3;
            AvAbsAcceleration: "abs acc, per step", "m/s^2", 2;
            AvAbsJerk: "abs jerk, per step", "m/s^3", 2;
            AvAbsLateral: "abs lateral acc, per step", "m/s^2", 3;
            AvMeanAcceleration: "mean abs acc, per scene", "m/s^2", 3;
            AvMeanJerk: "mean abs jerk, per scene", "m/s^3", 3;
            AvMeanLateral: "mean abs lateral acc, per scene", "m/s^2", 3;
        }
        Lanes {
            LanesPerScene: "lanes per scene (bike lanes and 1-point lanes left out)", "", 0;
            LaneLength: "lane length", "m", 1;
            BikeLaneLength: "bike lane length", "m", 1;
            Curvature: "curvature, over points (4 m base)", "1/m", 4;
            LargestCurvature: "largest curvature of a lane", "1/m", 3;
            Turn: "change of direction over a lane", "degrees", 1;
            LaneWidth: "distance left boundary to right boundary, where both exist", "m", 2;
            SpeedLimit: "speed limit, where given", "mph", 0;
            Exits: "exits per lane", "", 0;
            Entries: "entries per lane", "", 0;
        }
        Signals {
            SignalLanes: "signal-controlled lanes per scene (0 where none)", "", 0;
            SignalSteps: "share of steps with any signal, scenes with signals", "", 2;
            SignalChanges: "state changes of a lane in the scene (flicker with UNKNOWN counts)", "", 0;
            LanesPerJunction: "controlled lanes per junction (stop points joined within 60 m)", "", 0;
            NextJunction: "distance to the next signalled junction in the scene", "m", 0;
            ControlledLength: "length of a controlled lane (the one behind the stop line)", "m", 1;
            ArrowCautionTime: "ARROW_CAUTION duration (as observed, its end seen)", "s", 1;
            CautionTime: "CAUTION duration (as observed, its end seen)", "s", 1;
        }
        Areas {
            CrosswalkShort: "crosswalk short side (smallest enclosing rectangle)", "m", 2;
            CrosswalkLong: "crosswalk long side", "m", 1;
            Crosswalks: "crosswalks per scene", "", 0;
            StopSigns: "stop signs per scene", "", 0;
            SpeedBumps: "speed bumps per scene", "", 0;
            Driveways: "driveways per scene", "", 0;
            RoadLines: "road lines per scene", "", 0;
            RoadEdges: "road edges per scene", "", 0;
        }
    }
}

measured! {
    /// Something that is so or not so: told by how often it is.
    Share {
        Sizes {
            LongerThan6: "vehicles longer than 6.5 m", "", 1;
            LongerThan10: "vehicles longer than 10 m", "", 1;
            ShorterThan3: "vehicles shorter than 3.5 m", "", 1;
        }
        Parked {
            Parked: "vehicles seen for 5 s or more that stay within 1 m", "", 1;
            OnLane: "vehicle states within 60 m of the AV that lie on a lane (1.75 m, 0.5 rad)", "", 1;
        }
        Lanes {
            SurfaceStreet: "lanes (all) that are surface streets", "", 1;
            BikeLane: "lanes (all) for bicycles", "", 1;
            Freeway: "lanes (all) of freeways", "", 1;
            LimitUnknown: "lanes (all) without a speed limit", "", 1;
            LeftNeighbor: "lanes (all) with a left neighbour", "", 1;
            RightNeighbor: "lanes (all) with a right neighbour", "", 1;
            Interpolating: "lanes (all) that are interpolating", "", 1;
        }
        Signals {
            WithSignals: "scenes with signals", "", 1;
            Red: "signal entries that are red", "", 1;
            Yellow: "yellow", "", 1;
            Green: "green", "", 1;
            Unknown: "unknown", "", 1;
            RedOfKnown: "red of known", "", 1;
            YellowOfKnown: "yellow of known", "", 1;
            GreenOfKnown: "green of known", "", 1;
        }
        Areas {
            SolidSingleWhite: "road lines that are solid single white", "", 1;
            BrokenSingleWhite: "broken single white", "", 1;
            SolidDoubleYellow: "solid double yellow", "", 1;
            SolidSingleYellow: "solid single yellow", "", 1;
            PassingDoubleYellow: "passing double yellow", "", 1;
            EdgeBoundary: "road edges that are boundaries", "", 1;
            EdgeMedian: "road edges that are medians", "", 1;
        }
    }
}
