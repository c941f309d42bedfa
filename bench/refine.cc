// Rigs adjusted to people (RefineFromKeypoints): seconds and errors against the truth, on a synthetic take.
//   bench_refine [SEED] [OUT.json or -] [POINTS] [CAMERAS] [FOLDER]
// With FOLDER the take is written there, so that any build's `mvstudio calib refine` can be timed on it.
#include "calib/keypoints/refine.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <nlohmann/json.hpp>

#include "bench/quality.h"
#include "calib/keypoints/bundle.h"
#include "core/disk/files.h"
#include "dataset/pose/pose2d.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/rig_io.h"
#include "geometry/skeleton/skeleton.h"
#include "tests/calib/keypoint_support.h"

namespace mvstudio::bench {
namespace {

using calib::KeypointRefineReport;

constexpr int kJoints = 25;  // of body25

struct Take {
  geometry::Rig truth, given;  // every camera is off by about a degree and 5 cm
  std::vector<triangulate::DetectedFrame> frames;
};

Take MakeTake(int num_cameras, int num_points, uint64_t seed) {
  Take take;
  take.truth = calib::testing::PeopleRig(num_cameras);
  take.given = calib::testing::Disturbed(take.truth, 0.02, 0.05, seed);
  calib::testing::PeopleOptions options;
  options.num_joints = kJoints, options.num_frames = std::max(num_points / kJoints, 8), options.seed = seed;
  take.frames = calib::testing::FilmPeople(take.truth, options);
  return take;
}

nlohmann::ordered_json RowOf(const Take& take, int num_threads) {
  RunContext run;
  run.num_threads = num_threads;
  const std::clock_t cpu = std::clock();
  const Stopwatch watch;
  const KeypointRefineReport report = calib::RefineFromKeypoints(take.given, take.frames, {}, {}, {}, {}, run);
  const double seconds = watch.Seconds(), cpu_seconds = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  nlohmann::ordered_json row = {{"cameras", take.truth.cameras.size()},
                                {"points", take.frames.size() * kJoints},
                                {"points_used", report.num_train_joints},
                                {"threads", num_threads},
                                {"seconds", seconds},
                                {"cpu_seconds", cpu_seconds},
                                {"status", std::string(ToString(report.status))}};
  if (report.status != Status::kOk) return row;
  const geometry::RigDifference off = geometry::CompareRigs(report.rig, calib::AlignToGiven(take.truth, take.given));
  row["holdout_median_before_px"] = report.before.median_px, row["holdout_median_px"] = report.after.median_px;
  row["largest_rotation_deg"] = RadToDeg(off.max_rotation_rad);
  row["largest_translation_mm"] = 1e3 * off.max_translation_m;
  return row;
}

void Print(const nlohmann::ordered_json& row) {
  if (!row.contains("holdout_median_px")) return (void)std::printf("%s\n", row.dump().c_str());
  std::printf("%7d %8d %8d %8d %9.2f %9.2f %12.2f %9.2f %9.4f %9.2f\n", row["cameras"].get<int>(), row["points"].get<int>(),
              row["points_used"].get<int>(), row["threads"].get<int>(), row["seconds"].get<double>(),
              row["cpu_seconds"].get<double>(), row["holdout_median_before_px"].get<double>(),
              row["holdout_median_px"].get<double>(), row["largest_rotation_deg"].get<double>(),
              row["largest_translation_mm"].get<double>());
}

/// FOLDER/calibration.json and FOLDER/CAMERA/*.json, OpenPose.
void Write(const Take& take, const std::string& folder) {
  geometry::WriteRig(take.given, folder + "/calibration.json");
  for (size_t c = 0; c < take.given.cameras.size(); ++c) {
    dataset::Pose2dTrack track{take.given.cameras[c].camera.name, {}};
    for (const triangulate::DetectedFrame& frame : take.frames) {
      std::vector<dataset::Person2d>& people = track.frames[frame.frame];
      for (const triangulate::DetectedPerson& person : frame.people[c]) {
        dataset::Person2d& own = people.emplace_back();
        for (const triangulate::Keypoint& key : person) own.keypoints.push_back({key.px.x(), key.px.y(), key.score});
      }
    }
    dataset::WriteOpenPoseFolder(track, folder + "/" + track.camera);
  }
}

}  // namespace
}  // namespace mvstudio::bench

int main(int argc, char** argv) {
  using namespace mvstudio::bench;
  const uint64_t seed = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1;
  const int points = argc > 3 ? std::atoi(argv[3]) : 8000, cameras = argc > 4 ? std::atoi(argv[4]) : 12;
  const Take take = MakeTake(cameras, points, seed);
  if (argc > 5) Write(take, argv[5]);
  std::printf("%7s %8s %8s %8s %9s %9s %12s %9s %9s %9s\n", "cameras", "points", "used", "threads", "seconds", "cpu s",
              "before px", "after px", "deg", "mm");
  nlohmann::ordered_json rows;
  for (const int threads : {1, 2}) {
    rows.push_back(RowOf(take, threads));
    Print(rows.back());
    std::fflush(stdout);
  }
  if (argc > 2 && std::string(argv[2]) != "-")
    mvstudio::WriteFileAtomic(argv[2], nlohmann::ordered_json{{"seed", seed}, {"rows", rows}}.dump(1) + "\n");
  return 0;
}
