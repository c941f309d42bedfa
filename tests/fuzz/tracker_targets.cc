#include <cmath>
#include <filesystem>
#include <set>
#include <tuple>

#include "dataset/arrays/pickled_names.h"
#include "dataset/pose/markers.h"
#include "dataset/trackers/tracked_project.h"
#include "dataset/trackers/tracker_file.h"
#include "tests/fuzz/fuzz.h"

/// Files of programs that track animals and people, and of markers.
namespace mvstudio::fuzz {
namespace {

void RequireSound(const dataset::TrackedPoints& points) {
  Require(!points.joints.empty() && !points.individuals.empty(), "nobody has any joint");
  Require(std::set<std::string>(points.joints.begin(), points.joints.end()).size() == points.joints.size(), "a joint twice");
  for (const auto& [frame, people] : points.track.frames) {
    Require(frame >= 0, "a negative frame");
    for (const dataset::Person2d& person : people) {
      Require(person.keypoints.size() == points.joints.size(), "a person of another number of joints than the file");
      for (const dataset::Keypoint2d& key : person.keypoints) {
        Require(std::isfinite(key.x_px) && std::isfinite(key.y_px), "a joint that is not finite");
        Require(key.score >= 0 && key.score <= 1, "a score outside 0 … 1");
      }
    }
  }
  std::vector<dataset::TrackedPoints> cameras = {points};
  const std::vector<dataset::Pose2dTrack> tracks =
      dataset::ToSkeleton(cameras, geometry::PointsSkeleton(dataset::UnitedJoints(cameras)));
  Require(tracks[0].frames.size() == points.track.frames.size(), "frames were lost");
}

/// Tables and arrays of markers.
void RunMarkers(const std::string& path) {
  dataset::MarkerFile file;
  if (!Accepts([&] { file = dataset::ReadMarkers(path, "m"); })) return;
  std::set<std::tuple<int, int, std::string>> seen;
  for (const dataset::JointRow& row : file.pose.rows) {
    Require(row.status != Status::kOk || row.x_in_world.allFinite(), "a point that is Ok and not finite");
    Require(seen.emplace(row.frame, row.person, row.joint).second, "a point of a person twice in a frame");
  }
  Require(file.pose.frame_rate_hz >= 0 && std::isfinite(file.pose.frame_rate_hz), "a frame rate that is none");
}

void RunText(std::string_view bytes) {
  const std::string path = Scratch("tracker.csv", bytes);
  dataset::TrackedPoints points;
  if (Accepts([&] { points = dataset::ReadTrackerFile(path, "cam"); })) RequireSound(points);
}

}  // namespace

MVS_FUZZ_TARGET(deeplabcut_csv, bytes) { RunText(bytes); }

MVS_FUZZ_TARGET(sleap_csv, bytes) { RunText(bytes); }

MVS_FUZZ_TARGET(markers_csv, bytes) { RunMarkers(InMemory("in.csv", bytes)); }

MVS_FUZZ_TARGET(markers_sto, bytes) { RunMarkers(InMemory("in.sto", bytes)); }

MVS_FUZZ_TARGET(markers_npz, bytes) { RunMarkers(Scratch("in.npz", bytes)); }

MVS_FUZZ_TARGET(caliscope_points, bytes) {
  const std::string path = InMemory("xy.csv", bytes);
  dataset::CaliscopePoints points;
  if (!Accepts([&] { points = dataset::ReadCaliscopeCsv(path); })) return;
  for (const dataset::Pose2dTrack& track : points.set.tracks) {
    for (const auto& [frame, people] : track.frames) {
      for (const dataset::Person2d& person : people) {
        Require(person.keypoints.size() == points.set.skeleton.joints.size(), "a person of another number of joints");
      }
    }
  }
}

MVS_FUZZ_TARGET(pickled_names, bytes) { dataset::internal::ReadPickledNames(std::string(bytes)); }

// As shard_bytes: the library itself is not instrumented; what this project makes of its answers is.
MVS_FUZZ_TARGET(tracker_hdf5, bytes) {
  const std::string path = Scratch("tracker.h5", bytes);
  dataset::TrackedPoints points;
  if (Accepts([&] { points = dataset::ReadTrackerHdf5(path, "cam"); })) RequireSound(points);
}

MVS_FUZZ_TARGET(anipose_config, bytes) {
  const std::string folder = ScratchFolder("anipose");
  for (const char* below : {"/pose-2d", "/calibration"}) std::filesystem::create_directories(folder + below);
  Scratch("anipose/config.toml", bytes);
  Scratch("anipose/pose-2d/walk-camA.h5", "");
  Scratch("anipose/pose-2d/walk-camB.h5", "");
  Scratch("anipose/calibration/calibration.toml", "");
  dataset::TrackedProject project;
  if (!Accepts([&] { project = dataset::ReadTrackedProject(folder); })) return;
  Require(!project.takes.empty(), "a project without takes");
}

MVS_FUZZ_TARGET(c3d, bytes) {
  dataset::MarkerFile file;
  const std::string path = InMemory("in.c3d", bytes);
  if (!Accepts([&] { file = dataset::ReadMarkers(path); })) return;
  Require(dataset::MetresPerUnit(file.unit).has_value(), "a unit that is none");
  for (const dataset::JointRow& row : file.pose.rows) {
    Require(row.status != Status::kOk || row.x_in_world.allFinite(), "a point that is Ok and not finite");
    Require(row.frame >= 0 && row.person >= 0, "a negative frame or person");
  }
}

}  // namespace mvstudio::fuzz
