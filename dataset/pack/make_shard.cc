#include "dataset/pack/make_shard.h"

#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "dataset/footage/image_io.h"
#include "dataset/pack/image_codec.h"

namespace mvstudio::dataset::internal {
namespace {

namespace fs = std::filesystem;

/// Adds the seconds of its life to a sum.
class AddedTime {
 public:
  explicit AddedTime(double* sum_s) : sum_s_(sum_s) {}
  ~AddedTime() { *sum_s_ += watch_.Seconds(); }
  AddedTime(const AddedTime&) = delete;
  AddedTime& operator=(const AddedTime&) = delete;

 private:
  double* sum_s_;
  Stopwatch watch_;
};

struct InputFiles {
  std::string image, mask;                ///< paths; empty when not there
  std::string image_sha256, mask_sha256;  ///< hexadecimal; empty likewise
};

struct EncodedTarget {
  geometry::RigCamera view;
  std::string image, mask;
};

struct EncodedImage {
  InputFiles files;
  std::vector<EncodedTarget> targets;
  PackTimes times;
};

const geometry::RigCamera& SourceCamera(const PackPlan& plan, const PackImage& image) {
  return plan.dataset.rig.cameras[image.camera_idx];
}

InputFiles FindInputs(const PackPlan& plan, const PackImage& image) {
  InputFiles files;
  const std::string& camera = SourceCamera(plan, image).camera.name;
  files.image = plan.dataset.ImagePath(camera, image.frame);
  if (!fs::exists(files.image)) return {};
  files.image_sha256 = Sha256File(files.image);
  if (!plan.masks) return files;
  files.mask = plan.dataset.MaskPath(camera, image.frame);
  if (fs::exists(files.mask)) {
    files.mask_sha256 = Sha256File(files.mask);
  } else {
    files.mask.clear();
  }
  return files;
}

std::string InputsLine(const PackImage& image, const InputFiles& files) {
  return std::to_string(image.camera_idx) + " " + std::to_string(image.frame) + " " +
         (files.image.empty() ? "missing" : files.image_sha256) + " " + (files.mask.empty() ? "missing" : files.mask_sha256) +
         "\n";
}

Image Checked(Image image, const std::string& path, const geometry::Camera& camera) {
  if (image.width == camera.width_px && image.height == camera.height_px) return image;
  throw FormatError(path, "",
                    "is " + std::to_string(image.width) + "x" + std::to_string(image.height) + ", the calibration says " +
                        std::to_string(camera.width_px) + "x" + std::to_string(camera.height_px) + " for camera " +
                        camera.name);
}

// Whole images keep any value of 128 and more as foreground.
Image Binary(Image mask) {
  for (uint8_t& value : mask.pixels) value = value >= 128 ? 255 : 0;
  return mask;
}

struct Images {
  Image image, mask;  ///< the mask may be empty
};

Images Resampled(const PackPlan& plan, const ShardTools& tools, const PackImage& image, const geometry::RigCamera& view,
                 const Images& source) {
  const bool has_mask = !source.mask.empty();
  if (plan.view == PackView::kFull) return {source.image, has_mask ? Binary(source.mask) : Image()};
  if (plan.view == PackView::kUndistorted) {
    const Undistorter& undistorter = tools.undistorters.at(image.camera_idx);
    return {undistorter.Apply(source.image), has_mask ? undistorter.Mask(source.mask) : Image()};
  }
  const ResampleMap map(SourceCamera(plan, image), view);
  return {map.Apply(source.image), has_mask ? map.Mask(source.mask) : Image()};
}

EncodedImage Encode(const PackPlan& plan, const ShardTools& tools, const PackImage& image) {
  EncodedImage encoded;
  PackTimes& times = encoded.times;
  const geometry::RigCamera& camera = SourceCamera(plan, image);
  {
    const AddedTime added(&times.hash_s);
    encoded.files = FindInputs(plan, image);
  }
  if (encoded.files.image.empty()) return encoded;
  Images source;
  {
    const AddedTime added(&times.decode_s);
    const InputFiles& files = encoded.files;
    source.image = Checked(ReadImage(files.image), files.image, camera.camera);
    if (!files.mask.empty()) source.mask = Checked(ReadMask(files.mask, plan.dataset.Masks()), files.mask, camera.camera);
  }
  if (plan.options.match_colours && !plan.colour.cameras.empty()) {
    const AddedTime added(&times.resample_s);
    ApplyColour(plan.colour.cameras.at(image.camera_idx), plan.colour.space, &source.image);
  }
  for (const PackTarget& target : image.targets) {
    EncodedTarget made;
    Images images;
    {
      const AddedTime added(&times.resample_s);
      made.view = plan.view != PackView::kCrop
                      ? plan.views[image.camera_idx]
                      : CropCamera(camera, target.extent.middle_in_cam, plan.half_extent_m.at(target.person), plan.options.fill,
                                   plan.options.crop_px);
      images = Resampled(plan, tools, image, made.view, source);
    }
    const AddedTime added(&times.encode_s);
    made.image = EncodeImage(images.image, plan.options.codec);
    if (!images.mask.empty()) made.mask = EncodeMask(images.mask);
    encoded.targets.push_back(std::move(made));
  }
  return encoded;
}

void AddPoses(const PackPlan& plan, int frame, Shard* shard) {
  for (const auto& [person, pose] : plan.dataset.poses.at(frame)) {
    shard->pose_frame.push_back(frame);
    shard->pose_person.push_back(person);
    for (int j = 0; j < 19; ++j) {
      for (int k = 0; k < 3; ++k) shard->joints_in_world.push_back(pose.x_in_world(k, j));
      shard->confidence.push_back(pose.confidence[j]);
      shard->joint_valid.push_back(pose.valid[j]);
    }
  }
}

void AddView(const geometry::RigCamera& view, Shard* shard) {
  shard->size_px.insert(shard->size_px.end(), {view.camera.width_px, view.camera.height_px});
  const Eigen::Matrix3d k = view.camera.K();
  const Eigen::Matrix4d pose = geometry::ToMatrix(view.cam_from_world);
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) shard->intrinsics.push_back(k(row, col));
  }
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 4; ++col) shard->cam_from_world.push_back(pose(row, col));
  }
}

void AddJoints(const geometry::RigCamera& view, const Coco19Pose* pose, Shard* shard) {
  const geometry::Projector projector(view.camera);
  for (int j = 0; j < 19; ++j) {
    geometry::Projection projection;
    projection.status = Status::kTooFewViews;
    if (pose && pose->valid[j]) {
      projection = projector.Project(view.cam_from_world * Eigen::Vector3d(pose->x_in_world.col(j)));
    }
    const bool in_view = projection.status == Status::kOk && geometry::InImage(view.camera, projection.px);
    shard->joint_in_view.push_back(in_view);
    shard->joints_px.push_back(in_view ? projection.px[0] : 0);
    shard->joints_px.push_back(in_view ? projection.px[1] : 0);
  }
}

void AddDigest(const std::string& hex, std::vector<uint8_t>* column) {
  for (size_t k = 0; k < 32; ++k) {
    column->push_back(hex.empty() ? 0 : static_cast<uint8_t>(std::stoi(hex.substr(2 * k, 2), nullptr, 16)));
  }
}

int32_t PoseRow(const Shard& shard, int frame, int person) {
  for (size_t i = shard.pose_frame.size(); i-- > 0 && shard.pose_frame[i] == frame;) {
    if (shard.pose_person[i] == person) return static_cast<int32_t>(i);
  }
  return -1;
}

void AddSample(const PackPlan& plan, const PackImage& image, const PackTarget& target, const EncodedTarget& made,
               const InputFiles& files, double univ_time_ms, Shard* shard) {
  shard->camera.push_back(image.camera_idx);
  shard->frame.push_back(image.frame);
  shard->person.push_back(target.person);
  shard->pose.push_back(PoseRow(*shard, image.frame, target.person));
  shard->univ_time_ms.push_back(univ_time_ms);
  shard->part.push_back(static_cast<uint8_t>(image.part));
  AddView(made.view, shard);
  const Coco19Pose* pose = target.person < 0 ? nullptr : &plan.dataset.poses.at(image.frame).at(target.person);
  AddJoints(made.view, pose, shard);
  AddDigest(files.image_sha256, &shard->source_sha256);
  AddDigest(files.mask_sha256, &shard->mask_sha256);
  AddToBlob(made.image, made.mask, shard);
}

void AddTimes(const PackTimes& from, PackTimes* to) {
  to->decode_s += from.decode_s, to->hash_s += from.hash_s;
  to->resample_s += from.resample_s, to->encode_s += from.encode_s;
}

std::string ImageName(const PackPlan& plan, const PackImage& image) {
  return "camera " + SourceCamera(plan, image).camera.name + ", frame " + std::to_string(image.frame);
}

uint64_t LargestPair(const std::vector<EncodedImage>& images) {
  uint64_t largest = 0;
  for (const EncodedImage& image : images) {
    for (const EncodedTarget& t : image.targets) largest = std::max<uint64_t>(largest, t.image.size() + t.mask.size());
  }
  return largest;
}

}  // namespace

ShardTools MakeShardTools(const PackPlan& plan) {
  ShardTools tools;
  if (plan.view != PackView::kUndistorted) return tools;
  for (size_t i = 0; i < plan.views.size(); ++i) {
    tools.undistorters.emplace(static_cast<int>(i), Undistorter(plan.dataset.rig.cameras[i], plan.views[i]));
  }
  return tools;
}

MadeShard MakeShard(const PackPlan& plan, const ShardTools& tools, int number, const RunContext& run) {
  const std::vector<PackImage>& images = plan.shards[number];
  std::vector<EncodedImage> encoded(images.size());
  ParallelFor(static_cast<int64_t>(images.size()), ResolveThreads(run.num_threads),
              [&](int64_t i) { encoded[i] = Encode(plan, tools, images[i]); });
  MadeShard made;
  Shard& shard = made.shard;
  shard.plan = plan.json, shard.rig = plan.rig_json;
  shard.number = number, shard.num_shards = static_cast<int32_t>(plan.shards.size());
  shard.blob_chunk = ChooseBlobChunk(LargestPair(encoded));
  Sha256 inputs;
  double univ_time_ms = -1;
  for (size_t i = 0; i < images.size(); ++i) {
    if (i == 0 || images[i].frame != images[i - 1].frame) {
      AddPoses(plan, images[i].frame, &shard);
      univ_time_ms = ReadBody3dSceneFile(plan.scene_paths.at(images[i].frame)).univ_time_ms;
    }
    const EncodedImage& e = encoded[i];
    const std::string line = InputsLine(images[i], e.files);
    inputs.Update(line.data(), line.size());
    AddTimes(e.times, &made.times);
    if (e.files.image.empty()) made.skipped.push_back(ImageName(plan, images[i]) + ": no image");
    for (size_t k = 0; k < e.targets.size(); ++k) {
      AddSample(plan, images[i], images[i].targets[k], e.targets[k], e.files, univ_time_ms, &shard);
    }
    encoded[i].targets.clear();
  }
  made.inputs_sha256 = inputs.HexDigest();
  return made;
}

std::string InputsSha256(const PackPlan& plan, int number, const RunContext& run) {
  const std::vector<PackImage>& images = plan.shards[number];
  std::vector<std::string> lines(images.size());
  ParallelFor(static_cast<int64_t>(images.size()), ResolveThreads(run.num_threads),
              [&](int64_t i) { lines[i] = InputsLine(images[i], FindInputs(plan, images[i])); });
  Sha256 digest;
  for (const std::string& line : lines) digest.Update(line.data(), line.size());
  return digest.HexDigest();
}

}  // namespace mvstudio::dataset::internal
