#include "exports/joint_files.h"

#include <algorithm>
#include <limits>

#include "body/skeleton.h"
#include "core/disk/npy_write.h"
#include "core/error.h"

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

void WriteTrc(const Job& job) {
  RequirePeople(job);
  const std::vector<int> frames = ContinuousFrames(job.take);
  const std::vector<std::string>& joints = body::Coco19().joints;
  const std::string rate = Num(job.take.frame_rate_hz), count = std::to_string(frames.size());
  for (const int person : job.take.PersonIds()) {
    const std::string file = PersonFile(job.take, person, ".trc");
    std::string text =
        "PathFileType\t4\t(X/Y/Z)\t" + file +
        "\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n" + rate +
        "\t" + rate + "\t" + count + "\t19\tmm\t" + rate + "\t" + std::to_string(frames.front() + 1) + "\t" + count +
        "\nFrame#\tTime";
    for (const std::string& joint : joints) text += "\t" + joint + "\t\t";
    text += "\n\t";
    for (int j = 1; j <= 19; ++j) {
      for (const char* axis : {"X", "Y", "Z"}) text += std::string("\t") + axis + std::to_string(j);
    }
    text += "\n";
    for (const int frame : frames) {
      // The file counts frames from 1; its y is up and its z is our x.
      text += std::to_string(int64_t{frame} + 1) + "\t" + Num((frame - frames.front()) / job.take.frame_rate_hz);
      const dataset::Coco19Pose* pose = PoseOf(job.take, frame, person);
      for (int j = 0; j < 19; ++j) {
        if (!pose || !pose->valid[j]) {
          text += "\t\t\t";
          continue;
        }
        const Eigen::Vector3d mm = 1000 * pose->x_in_world.col(j);
        text += "\t" + Num(mm.y()) + "\t" + Num(mm.z()) + "\t" + Num(mm.x());
      }
      text += "\n";
    }
    job.Write(file, text);
  }
}

void WriteCsv(const Job& job) {
  RequirePeople(job);
  std::string text = "frame,person,joint,x_m,y_m,z_m,confidence\n";
  for (const int frame : job.take.frames) {
    for (const auto& [id, pose] : job.take.At(frame)) {
      for (size_t j = 0; j < 19; ++j) {
        if (!pose.valid[j]) continue;
        text += std::to_string(frame) + "," + std::to_string(id) + "," + body::Coco19().joints[j];
        for (int k = 0; k < 3; ++k) text += "," + Num(pose.x_in_world(k, static_cast<Eigen::Index>(j)));
        text += "," + Num(pose.confidence[j]) + "\n";
      }
    }
  }
  job.Write("joints.csv", text);
}

void WriteNpz(const Job& job) {
  const std::vector<int> people = job.take.PersonIds();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> joints, confidence;
  for (const int frame : job.take.frames) {
    for (const int person : people) {
      const dataset::Coco19Pose* pose = PoseOf(job.take, frame, person);
      for (size_t j = 0; j < 19; ++j) {
        const bool valid = pose && pose->valid[j];
        for (int k = 0; k < 3; ++k) joints.push_back(valid ? pose->x_in_world(k, static_cast<Eigen::Index>(j)) : nan);
        confidence.push_back(valid ? pose->confidence[j] : 0);
      }
    }
  }
  const size_t num_frames = job.take.frames.size(), num_people = people.size();
  std::vector<std::pair<std::string, std::string>> arrays = {
      {"joints", NpyOfDoubles({num_frames, num_people, 19, 3}, joints)},
      {"confidence", NpyOfDoubles({num_frames, num_people, 19}, confidence)},
      {"joint_names", NpyOfTexts(body::Coco19().joints)},
      {"frames", NpyOfInts({num_frames}, std::vector<int64_t>(job.take.frames.begin(), job.take.frames.end()))},
      {"people", NpyOfInts({num_people}, std::vector<int64_t>(people.begin(), people.end()))}};
  for (auto& array : CameraArrays(job.take)) arrays.push_back(std::move(array));
  job.Write("joints.npz", NpzOf(arrays));
}

}  // namespace mvstudio::exports
