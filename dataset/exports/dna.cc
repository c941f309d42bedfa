#include <limits>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/arrays/hdf5_writer.h"
#include "dataset/exports/joint_files.h"

/// The SMC files of DNA-Rendering (HDF5), as read by its SMCReader: main/SEQ.smc with the encoded images,
/// annotations/SEQ_annots.smc with cameras (RT is camera to world), masks and keypoints.
namespace mvstudio::exports {
namespace {

using dataset::internal::Hdf5Writer;

/// The reader pads a camera's number for parameters and keypoints but not for images and masks.
std::string Padded(size_t camera) { return Numbered("", static_cast<int>(camera), 2, ""); }

void AddCameras(const Take& take, Hdf5Writer* file) {
  for (size_t i = 0; i < take.views.size(); ++i) {
    const geometry::RigCamera& camera = take.views[i].camera;
    const std::string group = "/Camera_Parameter/" + Padded(i);
    const auto distortion = *Brown5Of(camera.camera);
    const std::vector<double> identity = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    file->Array(group + "/K", {3, 3}, MatrixOf(camera.camera).data());
    file->Array(group + "/D", {5}, distortion.data());
    file->Array(group + "/RT", {4, 4}, RowsOf(Inverse(camera.cam_from_world)).data());
    file->Array(group + "/Color_Calibration", {3, 3}, identity.data());
    const int64_t size[] = {camera.camera.width_px, camera.camera.height_px};
    file->Array(group + "/size_px", {2}, size);
    file->Attribute(group, "name", take.views[i].info.name);
  }
}

/// (F, 19, 4): x, y, z in metres, confidence; 0 where there is no joint.
std::vector<double> Keypoints3d(const Take& take, int person) {
  std::vector<double> values;
  for (const int frame : take.frames) {
    const dataset::Coco19Pose* pose = PoseOf(take, frame, person);
    for (int j = 0; j < 19; ++j) {
      const bool valid = pose && pose->valid[j];
      for (int k = 0; k < 3; ++k) values.push_back(valid ? pose->x_in_world(k, j) : 0);
      values.push_back(valid ? pose->confidence[j] : 0);
    }
  }
  return values;
}

/// (F, 19, 3): x, y in px, confidence; 0 where the joint is not in the image.
std::vector<double> Keypoints2d(const Take& take, const geometry::RigCamera& camera, int person) {
  const geometry::Projector projector(camera.camera);
  std::vector<double> values;
  for (const int frame : take.frames) {
    const dataset::Coco19Pose* pose = PoseOf(take, frame, person);
    for (int j = 0; j < 19; ++j) {
      geometry::Projection seen;
      seen.status = Status::kTooFewViews;
      if (pose && pose->valid[j]) seen = projector.Project(camera.cam_from_world * Eigen::Vector3d(pose->x_in_world.col(j)));
      const bool visible = seen.status == Status::kOk && InImage(camera.camera, seen.px);
      values.insert(values.end(), {visible ? seen.px.x() : 0, visible ? seen.px.y() : 0, visible ? pose->confidence[j] : 0});
    }
  }
  return values;
}

void AddKeypoints(const Job& job, Hdf5Writer* file) {
  const Take& take = job.take;
  const std::vector<int> people = take.PersonIds();
  if (people.empty()) return;
  if (people.size() > 1) {
    job.report->notes.push_back({"EXP-ONE-PERSON",
                                 "an SMC file holds one actor: person " + std::to_string(people[0]) + " of " +
                                     std::to_string(people.size()) + " is written",
                                 "csv and npz hold all of them"});
  }
  const uint64_t frames = take.frames.size();
  file->Array("/Keypoints_3D/keypoints3d", {frames, 19, 4}, Keypoints3d(take, people[0]).data());
  for (size_t i = 0; i < take.views.size(); ++i) {
    file->Array("/Keypoints_2D/" + Padded(i), {frames, 19, 3}, Keypoints2d(take, take.views[i].camera, people[0]).data());
  }
}

void AddBytes(const std::string& bytes, const std::string& path, Hdf5Writer* file) {
  if (bytes.empty()) return;
  file->Array(path, {bytes.size()}, reinterpret_cast<const uint8_t*>(bytes.data()), {{bytes.size()}, 0});
}

/// A file is put together in memory; more than this is asked for in parts.
class Budget {
 public:
  void Add(size_t bytes) {
    constexpr uint64_t kMostBytes = 8ull << 30;
    total_ += bytes;
    if (total_ > kMostBytes)
      throw UsageError("an SMC file of more than 8 GiB; choose fewer option 'frames' or option 'cameras'");
  }

 private:
  uint64_t total_ = 0;
};

std::string MainFile(const Job& job, const std::string& label) {
  const Take& take = job.take;
  Hdf5Writer file(label);
  Budget budget;
  file.Group("/Camera_5mp");
  for (size_t i = 0; i < take.views.size(); ++i) {
    for (size_t f = 0; f < take.frames.size(); ++f) {
      const std::string bytes = job.images.EncodedImage(i, take.frames[f]);
      budget.Add(bytes.size());
      AddBytes(bytes, "/Camera_5mp/" + std::to_string(i) + "/color/" + std::to_string(f), &file);
    }
  }
  const geometry::Camera& lens = take.views[0].camera.camera;
  file.Attribute("/Camera_5mp", "num_device", static_cast<int64_t>(take.views.size()));
  file.Attribute("/Camera_5mp", "num_frame", static_cast<int64_t>(take.frames.size()));
  file.Attribute("/Camera_5mp", "resolution", std::to_string(lens.height_px) + "x" + std::to_string(lens.width_px));
  return std::string(file.Finish().view());
}

std::string AnnotationFile(const Job& job, const std::string& label) {
  const Take& take = job.take;
  Hdf5Writer file(label);
  AddCameras(take, &file);
  if (!take.frames.empty()) {
    AddKeypoints(job, &file);
    for (size_t i = 0; i < take.views.size(); ++i) {
      for (size_t f = 0; f < take.frames.size(); ++f) {
        AddBytes(job.images.EncodedMask(i, take.frames[f]), "/Mask/" + std::to_string(i) + "/mask/" + std::to_string(f), &file);
      }
    }
    const std::vector<int64_t> numbers(take.frames.begin(), take.frames.end());
    file.Array("/mvstudio/frame_numbers", numbers);
  }
  return std::string(file.Finish().view());
}

}  // namespace

void WriteDna(const Job& job) {
  const std::string annotations = "annotations/" + job.take.sequence + "_annots.smc";
  job.Write(annotations, AnnotationFile(job, annotations));
  const std::string main = "main/" + job.take.sequence + ".smc";
  if (!job.take.frames.empty()) job.Write(main, MainFile(job, main));
}

}  // namespace mvstudio::exports
