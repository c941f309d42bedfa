#include "dataset/exports/joint_files.h"

#include <algorithm>
#include <limits>

#include "core/csv.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "dataset/markers/marker_files.h"
#include "geometry/skeleton/skeleton.h"

namespace mvstudio::exports {
namespace {

/// (V, …) arrays of the cameras as exported.
std::vector<std::pair<std::string, std::string>> CameraArrays(const Take& take) {
  std::vector<double> k, distortion, cam_from_world;
  std::vector<int64_t> sizes;
  std::vector<std::string> names;
  for (const View& view : take.views) {
    const geometry::Camera& lens = view.camera.camera;
    const std::vector<double> matrix = MatrixOf(lens), transform = RowsOf(view.camera.cam_from_world);
    const auto brown = *Brown5Of(lens);
    k.insert(k.end(), matrix.begin(), matrix.end());
    distortion.insert(distortion.end(), brown.data(), brown.data() + 5);
    cam_from_world.insert(cam_from_world.end(), transform.begin(), transform.end());
    sizes.insert(sizes.end(), {lens.width_px, lens.height_px});
    names.push_back(view.info.name);
  }
  const size_t count = take.views.size();
  return {{"camera_names", NpyOfTexts(names)},
          {"K", NpyOfDoubles({count, 3, 3}, k)},
          {"distCoef", NpyOfDoubles({count, 5}, distortion)},
          {"cam_from_world", NpyOfDoubles({count, 4, 4}, cam_from_world)},
          {"size_px", NpyOfInts({count, 2}, sizes)}};
}

}  // namespace

std::vector<int> ContinuousFrames(const Take& take) {
  constexpr int64_t kMostFrames = 1000000;
  const int64_t span = int64_t{take.frames.back()} - take.frames.front() + 1;
  if (span > kMostFrames) {
    throw UsageError("frames " + std::to_string(take.frames.front()) + " to " + std::to_string(take.frames.back()) +
                     ": this format has one line a time step, which would be " + std::to_string(span) +
                     "; choose a shorter stretch with option 'frames'");
  }
  std::vector<int> frames;
  for (int64_t i = 0; i < span; ++i) frames.push_back(static_cast<int>(take.frames.front() + i));
  return frames;
}

const dataset::Coco19Pose* PoseOf(const Take& take, int frame, int person) {
  const People& people = take.At(frame);
  const auto found = people.find(person);
  return found == people.end() ? nullptr : &found->second;
}

std::string PersonFile(const Take& take, int person, const std::string& extension) {
  return take.sequence + "_person" + std::to_string(person) + extension;
}

const geometry::Skeleton& SkeletonOf(const Take& take) { return take.own ? take.own->skeleton : geometry::Coco19(); }

std::optional<dataset::JointsPose> JointsOf(const Take& take, int frame, int person) {
  if (take.own) {
    const auto people = take.own->poses.find(frame);
    if (people == take.own->poses.end()) return std::nullopt;
    const auto found = people->second.find(person);
    return found == people->second.end() ? std::nullopt : std::optional(found->second);
  }
  const dataset::Coco19Pose* pose = PoseOf(take, frame, person);
  if (!pose) return std::nullopt;
  dataset::JointsPose joints;
  joints.x_in_world = pose->x_in_world;
  joints.valid.assign(pose->valid.begin(), pose->valid.end());
  joints.confidence.assign(pose->confidence.begin(), pose->confidence.end());
  return joints;
}

void NoteJointsBeside(const Job& job) {
  if (!job.take.own) return;
  job.report->notes.push_back({"EXP-JOINTS",
                               "the files hold Panoptic's 19 joints, not all of skeleton " + job.take.own->skeleton.name,
                               "trc, c3d, csv and npz hold them all"});
}

markers::MarkerTake MarkersOf(const Take& take, int person) {
  markers::MarkerTake markers;
  const std::vector<int> frames = ContinuousFrames(take);
  markers.person = person, markers.rate_hz = take.frame_rate_hz, markers.first_frame = frames.front();
  markers.names = SkeletonOf(take).joints;
  for (const int frame : frames) {
    const auto pose = JointsOf(take, frame, person);
    for (size_t j = 0; j < markers.names.size(); ++j) {
      const bool valid = pose && pose->valid[j];
      markers.x_in_world.push_back(valid ? Eigen::Vector3d(pose->x_in_world.col(static_cast<Eigen::Index>(j)))
                                         : Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
      markers.source.push_back(valid ? markers::Source::kMeasured : markers::Source::kMissing);
    }
  }
  markers.sigma_m.assign(markers.source.size(), 0);
  return markers;
}

void WriteTrc(const Job& job) {
  RequirePeople(job);
  for (const int person : job.take.PersonIds()) {
    const std::string file = PersonFile(job.take, person, ".trc");
    job.Write(file, markers::TrcText(MarkersOf(job.take, person), file, job.options.trc_unit));
  }
}

void WriteCsv(const Job& job) {
  RequirePeople(job);
  const std::vector<std::string>& names = SkeletonOf(job.take).joints;
  std::string text = "frame,person,joint,x_m,y_m,z_m,confidence\n";
  for (const int frame : job.take.frames) {
    for (const auto& [id, unused] : job.take.At(frame)) {
      const auto pose = JointsOf(job.take, frame, id);
      for (size_t j = 0; pose && j < names.size(); ++j) {
        if (!pose->valid[j]) continue;
        text += std::to_string(frame) + "," + std::to_string(id) + "," + CsvCell(names[j]);
        for (int k = 0; k < 3; ++k) text += "," + Num(pose->x_in_world(k, static_cast<Eigen::Index>(j)));
        text += "," + Num(pose->confidence[j]) + "\n";
      }
    }
  }
  job.Write("joints.csv", text);
}

void WriteNpz(const Job& job) {
  const std::vector<int> people = job.take.PersonIds();
  const std::vector<std::string>& names = SkeletonOf(job.take).joints;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> joints, confidence;
  for (const int frame : job.take.frames) {
    for (const int person : people) {
      const auto pose = JointsOf(job.take, frame, person);
      for (size_t j = 0; j < names.size(); ++j) {
        const bool valid = pose && pose->valid[j];
        for (int k = 0; k < 3; ++k) joints.push_back(valid ? pose->x_in_world(k, static_cast<Eigen::Index>(j)) : nan);
        confidence.push_back(valid ? pose->confidence[j] : 0);
      }
    }
  }
  const size_t num_frames = job.take.frames.size(), num_people = people.size();
  std::vector<std::pair<std::string, std::string>> arrays = {
      {"joints", NpyOfDoubles({num_frames, num_people, names.size(), 3}, joints)},
      {"confidence", NpyOfDoubles({num_frames, num_people, names.size()}, confidence)},
      {"joint_names", NpyOfTexts(names)},
      {"frames", NpyOfInts({num_frames}, std::vector<int64_t>(job.take.frames.begin(), job.take.frames.end()))},
      {"people", NpyOfInts({num_people}, std::vector<int64_t>(people.begin(), people.end()))}};
  for (auto& array : CameraArrays(job.take)) arrays.push_back(std::move(array));
  job.Write("joints.npz", NpzOf(arrays));
}

}  // namespace mvstudio::exports
