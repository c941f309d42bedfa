#include "dataset/markers/gait_events.h"

#include <cmath>

#include "core/random.h"
#include "core/units.h"
#include "dataset/pose/markers.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::markers {
namespace {

using Eigen::Vector3d;

constexpr double kStride = 1.1, kStance = 0.62;  // seconds; share of a stride on the ground

/// Where a foot is: it stands from a strike on for kStance of the stride, then swings a stride's length ahead.
struct Foot {
  double x = 0, z = 0, pitch = 0;
};
Foot FootAt(double t, double phase, double speed) {
  const double cycle = t / kStride + phase, whole = std::floor(cycle), share = cycle - whole;
  const double length = speed * kStride;
  Foot foot;
  foot.x = (whole - phase) * length + 0.3 * length;
  if (share < kStance) {
    foot.pitch = share > 0.4 ? 0.5 * (share - 0.4) / (kStance - 0.4) : 0;  // the heel rises before the toes leave
    return foot;
  }
  const double s = (share - kStance) / (1 - kStance);
  foot.x += length * (s - std::sin(2 * kPi * s) / (2 * kPi));
  foot.z = 0.08 * std::sin(kPi * s) * std::sin(kPi * s);
  foot.pitch = 0.5 * (1 - s) * (1 - s);
  return foot;
}

/// Along +y of the world. `treadmill`: the ground moves instead.
MarkerTake Walk(double speed, bool treadmill, double noise_m) {
  MarkerTake take;
  take.rate_hz = 100, take.first_frame = 20, take.names = {"LHip", "RHip", "LHeel", "RHeel", "LBigToe", "RBigToe"};
  Rng rng(3);
  for (int f = 0; f < 600; ++f) {
    const double t = f / take.rate_hz, way = speed * t;
    const auto put = [&](double right, double ahead, double up) {
      take.x_in_world.push_back(Vector3d(right, ahead - (treadmill ? way : 0), up) +
                                noise_m * Vector3d(rng.Normal(), rng.Normal(), rng.Normal()));
    };
    put(-0.1, way, 0.95), put(0.1, way, 0.95);
    for (const bool toe : {false, true}) {
      for (const int side : {0, 1}) {
        const Foot foot = FootAt(t, side == 0 ? 0 : 0.5, speed);
        const double lift = toe ? 0 : 0.2 * std::sin(foot.pitch);
        put(side == 0 ? -0.1 : 0.1, foot.x + (toe ? 0.2 : 0.2 * (1 - std::cos(foot.pitch))), foot.z + lift + 0.03);
      }
    }
  }
  take.source.assign(take.x_in_world.size(), Source::kMeasured);
  take.sigma_m.assign(take.x_in_world.size(), 0);
  return take;
}

/// Seconds from the event to the nearest true one.
double Error(const GaitEvent& event) {
  const double t = (event.frame - 20) / 100.0, phase = event.left ? 0 : 0.5;
  const double at = (event.kind == GaitEventKind::kHeelStrike ? 0 : kStance) - phase;
  const double cycles = t / kStride - at;
  return (cycles - std::round(cycles)) * kStride;
}

TEST(GaitEvents, AreWhereFeetMeetAndLeaveTheGround) {
  for (const bool treadmill : {false, true}) {
    const GaitReport report = FindGaitEvents(Walk(1.3, treadmill, 0.003), true);
    int strikes = 0, sure = 0;
    for (const GaitEvent& event : report.events) {
      EXPECT_LT(std::abs(Error(event)), 0.08)
          << event.frame << " " << ToString(event.kind) << (event.left ? " left" : " right");
      strikes += event.kind == GaitEventKind::kHeelStrike, sure += event.confidence != GaitConfidence::kLow;
    }
    EXPECT_GE(strikes, 8) << "ten in six seconds, but for the ends";
    EXPECT_GE(static_cast<int>(report.events.size()) - strikes, 8);
    EXPECT_GE(sure, static_cast<int>(report.events.size()) / 2);
    EXPECT_NEAR(report.speed_m_s, treadmill ? 0 : 1.3, 0.03);
    EXPECT_NEAR(report.cadence_per_min, 120 / kStride, 4);
  }
}

TEST(GaitEvents, NobodyWalksIsAnAnswer) {
  const GaitReport stands = FindGaitEvents(Walk(0, false, 0.003), true);
  EXPECT_TRUE(stands.events.empty());
  EXPECT_THAT(stands.why_none, HasSubstr("does not walk"));
  const GaitReport backwards = FindGaitEvents(
      [] {
        MarkerTake take = Walk(1.3, false, 0);
        std::swap(take.names[0], take.names[1]);  // the hips face the other way
        return take;
      }(),
      true);
  EXPECT_TRUE(backwards.events.empty());
  EXPECT_FALSE(backwards.why_none.empty());
  EXPECT_THAT(FindGaitEvents(Walk(1.3, false, 0), false).why_none, HasSubstr("nothing is up"));
  MarkerTake hips = Walk(1.3, false, 0);
  for (size_t m = 2; m < 6; ++m) hips.names[m] = "x" + std::to_string(m);
  EXPECT_THAT(FindGaitEvents(hips, true).why_none, HasSubstr("needed"));
}

TEST(GaitEvents, OfRecordedPeople) {
  MVS_NEEDS_DATA("bvh");
  const std::string folder = mvstudio::testing::DataRoot() + "/bvh/";
  const auto events = [&](const std::string& name, const std::string& up) {
    const dataset::MarkerFile file = dataset::ReadMarkers(folder + name, "cm", up);
    return FindGaitEvents(MarkersOf(file.pose, file.pose.frame_rate_hz).at(0), true);
  };
  const GaitReport walks = events("zombie.bvh", "z");
  EXPECT_GE(walks.events.size(), 40u);
  EXPECT_THAT(walks.note, HasSubstr("ankles"));
  for (size_t i = 1; i < walks.events.size(); ++i) {  // the other foot leaves after each strike
    const GaitEvent &a = walks.events[i - 1], &b = walks.events[i];
    EXPECT_NE(a.kind, b.kind) << b.frame;
    EXPECT_EQ(a.kind == GaitEventKind::kHeelStrike, a.left != b.left) << b.frame;
  }
  for (const char* name : {"dab.bvh", "jumping.bvh", "wave_hello.bvh"}) EXPECT_TRUE(events(name, "z").events.empty()) << name;
  EXPECT_TRUE(events("jumping_jacks.bvh", "y").events.empty());
}

}  // namespace
}  // namespace mvstudio::markers
