#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "tests/triangulate/people.h"
#include "tests/triangulate/support.h"
#include "triangulate/sync/sync.h"

/// Clocks of other rates, against times that are known exactly.
namespace mvstudio::triangulate {
namespace {

constexpr double kHz = 60;

geometry::Rig MakeStudio() {
  geometry::Rig rig;
  for (int i = 0; i < 4; ++i) {
    const double angle = 2 * kPi * (i + 0.3) / 4;
    rig.cameras.push_back(LookAt("cam_" + std::to_string(i), {4.5 * std::cos(angle), 4.5 * std::sin(angle), i % 2 ? 2.4 : 1.3},
                                 {0, 0, 0.9}, 1150 + 30 * i, 1920, 1088));
  }
  return rig;
}

/// A person who walks and waves, without a period that a shift in time could fall into.
Walker WalkerAt(double t) {
  Walker w;
  w.position = {0.9 * std::sin(0.7 * t) + 0.2 * std::sin(1.9 * t), 0.9 * std::cos(0.5 * t)};
  w.heading = 0.6 * t + 0.5 * std::sin(1.3 * t);
  w.phase = 5 * t;
  w.arm_left = 0.4 + 0.8 * std::sin(2.3 * t), w.arm_right = 0.3 + 0.9 * std::sin(1.7 * t);
  return w;
}

/// What cameras with these clocks film in `seconds`: frame offset + rate * f of a camera is at f / kHz.
std::vector<DetectedFrame> Film(const geometry::Rig& rig, const std::vector<Clock>& clocks, double seconds) {
  DetectorOptions options;
  options.noise_px = 1, options.outlier_joints = 0, options.false_people = 0;
  Rng rng(11);
  std::map<int, DetectedFrame> frames;
  for (size_t c = 0; c < clocks.size(); ++c) {
    for (int k = 0; k < seconds * kHz * clocks[c].rate; ++k) {
      const double t = (k - clocks[c].offset_frames) / clocks[c].rate / kHz;
      DetectedFrame& frame = frames[k];
      frame.frame = k;
      frame.people.resize(clocks.size());
      frame.people[c] = Detect(rig, {WalkerAt(t)}, k, options, &rng).frame.people[c];
    }
  }
  std::vector<DetectedFrame> list;
  for (auto& [k, frame] : frames) list.push_back(std::move(frame));
  return list;
}

/// Largest error of a camera's clock over the take, ms.
double WorstMs(const SyncResult& found, const std::vector<Clock>& truth, double seconds) {
  double worst = 0;
  const Clock reference = truth[static_cast<size_t>(found.reference_idx)];
  for (size_t c = 0; c < truth.size(); ++c) {
    for (const double at : {0.0, 0.5, 1.0}) {
      const double tick = at * seconds * kHz, frame = reference.offset_frames + reference.rate * tick;
      const Clock clock = found.cameras[c].clock();
      const double error = clock.offset_frames + clock.rate * frame - truth[c].offset_frames - truth[c].rate * tick;
      worst = std::max(worst, std::abs(error / truth[c].rate) * 1000 / kHz);
    }
  }
  return worst;
}

void ExpectFound(const std::string& what, const std::vector<Clock>& clocks, double seconds, double most_ms) {
  SCOPED_TRACE(what);
  const geometry::Rig rig = MakeStudio();
  const SyncResult found = SynchronizeCameras(Prepare(rig), Film(rig, clocks, seconds), {});
  ASSERT_EQ(found.status, SyncStatus::kOk) << ToString(found.status);
  EXPECT_LT(WorstMs(found, clocks, seconds), most_ms);
}

TEST(Clocks, EqualOnesAreNotMadeToDrift) {
  const geometry::Rig rig = MakeStudio();
  const SyncResult found = SynchronizeCameras(Prepare(rig), Film(rig, {{0, 1}, {7.4, 1}, {-3.2, 1}, {0, 1}}, 6), {});
  ASSERT_EQ(found.status, SyncStatus::kOk);
  for (const CameraSync& camera : found.cameras) EXPECT_EQ(camera.clock().rate, 1) << camera.name;
}

TEST(Clocks, RatesAreFound) {
  ExpectFound("60 and 30 Hz", {{0, 1}, {0.5, 1}, {0, 0.5}, {5, 0.5}}, 6, 1);
  ExpectFound("60 and 150 Hz", {{0, 1}, {0, 2.5}, {4, 1}, {20, 2.5}}, 4, 1);
}

TEST(Clocks, DriftsAreFound) {
  ExpectFound("59.94 and 60 Hz", {{0, 1}, {3, 1}, {0, 1000.0 / 1001}, {-8.5, 1000.0 / 1001}}, 12, 1);
  ExpectFound("300 ppm", {{0, 1}, {2, 1 + 3e-4}, {0, 1}, {-20, 1}}, 30, 1);
}

}  // namespace
}  // namespace mvstudio::triangulate
