#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "dataset/panoptic/missing.h"
#include "dataset/views/crop.h"
#include "dataset/views/person_extents.h"
#include "python/samples.h"

namespace mvstudio::python {
namespace {

namespace py = pybind11;
using dataset::PackSample;
using dataset::PanopticDataset;

class PackSource : public SampleSource {
 public:
  explicit PackSource(dataset::Pack pack) : pack_(std::move(pack)) {}

  const geometry::Rig& rig() const override { return pack_.rig(); }
  const std::vector<PackSample>& samples() const override { return pack_.samples(); }
  Image ReadImage(size_t i) const override { return pack_.ReadImage(i); }
  Image ReadMask(size_t i) const override { return pack_.ReadMask(i); }
  std::string ReadImageBytes(size_t i) const override { return pack_.ReadImageBytes(i); }
  py::dict About() const override {
    const dataset::PackInfo& info = pack_.info();
    py::dict about;
    about["sequence"] = info.sequence, about["codec"] = info.image_codec, about["mask_codec"] = info.mask_codec;
    about["plan"] = info.plan_json, about["bytes"] = info.bytes, about["shards"] = info.shards;
    return about;
  }

 private:
  dataset::Pack pack_;
};

/// Images of a dataset's files, as `avatar train` crops them.
class DatasetSource : public SampleSource {
 public:
  DatasetSource(PanopticDataset data, const DatasetSourceOptions& options, double half_extent_m)
      : data_(std::move(data)), options_(options), half_extent_m_(half_extent_m) {}

  void Add(PackSample sample) { samples_.push_back(std::move(sample)); }
  const PanopticDataset& data() const { return data_; }
  geometry::RigCamera ViewOf(const geometry::RigCamera& camera, const Eigen::Vector3d& middle_in_cam) const {
    if (options_.crop_px == 0) return camera;
    return dataset::CropCamera(camera, middle_in_cam, half_extent_m_, options_.fill, options_.crop_px);
  }

  const geometry::Rig& rig() const override { return data_.rig; }
  const std::vector<PackSample>& samples() const override { return samples_; }
  Image ReadImage(size_t i) const override {
    const std::string path = data_.ImagePath(CameraOf(i).camera.name, samples_[i].frame);
    const Image image = Checked(dataset::ReadImage(path), path, CameraOf(i).camera);
    return options_.crop_px == 0 ? image : dataset::Resample(image, CameraOf(i), samples_[i].view);
  }
  Image ReadMask(size_t i) const override {
    if (!samples_[i].has_mask) return {};
    const std::string& camera = CameraOf(i).camera.name;
    Image mask =
        Checked(data_.ReadMask(camera, samples_[i].frame), data_.MaskPath(camera, samples_[i].frame), CameraOf(i).camera);
    if (options_.crop_px > 0) mask = dataset::Resample(mask, CameraOf(i), samples_[i].view);
    for (uint8_t& value : mask.pixels) value = value >= 128 ? 255 : 0;
    return mask;
  }
  std::string ReadImageBytes(size_t) const override {
    throw UsageError("a dataset stores no crops: take its files, or a pack");
  }
  py::dict About() const override {
    py::dict about;
    about["sequence"] = data_.sequence, about["half_extent_m"] = half_extent_m_;
    return about;
  }

 private:
  const geometry::RigCamera& CameraOf(size_t i) const { return data_.rig.cameras[samples_[i].camera_idx]; }
  static Image Checked(Image image, const std::string& path, const geometry::Camera& camera) {
    if (image.width == camera.width_px && image.height == camera.height_px) return image;
    throw FormatError(path, "",
                      "is " + std::to_string(image.width) + "x" + std::to_string(image.height) + ", the calibration says " +
                          std::to_string(camera.width_px) + "x" + std::to_string(camera.height_px) + " for camera " +
                          camera.name);
  }

  PanopticDataset data_;
  DatasetSourceOptions options_;
  double half_extent_m_;
  std::vector<PackSample> samples_;
};

void RequireSane(const DatasetSourceOptions& o) {
  if (o.crop_px != 0 && (o.crop_px < 8 || o.crop_px > 4096))
    throw UsageError("option 'crop' " + std::to_string(o.crop_px) + ": use 8 to 4096 px, or 0 for whole images");
  if (!(o.fill > 0.05 && o.fill <= 2)) throw UsageError("option 'fill': use 0.05 to 2");
  if (!(o.half_extent_m >= 0 && o.half_extent_m < 100))
    throw UsageError("option 'half-extent-m': use metres, or 0 for the person's own");
}

std::vector<int> FramesOf(const PanopticDataset& data, int person) {
  std::vector<int> frames;
  for (const auto& [frame, people] : data.poses) {
    if (people.count(person)) frames.push_back(frame);
  }
  return frames;
}

void FillJoints(PackSample* sample) {
  const geometry::Projector projector(sample->view.camera);
  for (int j = 0; j < 19; ++j) {
    if (!sample->pose.valid[j]) continue;
    const geometry::Projection seen =
        projector.Project(sample->view.cam_from_world * Eigen::Vector3d(sample->pose.x_in_world.col(j)));
    sample->in_view[j] = seen.status == Status::kOk && geometry::InImage(sample->view.camera, seen.px);
    if (sample->in_view[j]) sample->joints_px.col(j) = seen.px;
  }
}

/// Nothing: the person is not in front of the camera.
std::optional<PackSample> SampleAt(const DatasetSource& source, size_t camera_idx, int frame, int person) {
  const geometry::RigCamera& camera = source.rig().cameras[camera_idx];
  PackSample sample;
  sample.camera_idx = static_cast<int>(camera_idx), sample.frame = frame, sample.person = person;
  sample.pose = source.data().poses.at(frame).at(person);
  const auto extent = dataset::MeasurePerson(sample.pose, camera);
  if (!extent) return std::nullopt;
  sample.view = source.ViewOf(camera, extent->middle_in_cam);
  FillJoints(&sample);
  return sample;
}

std::optional<dataset::Split> SplitOf(const std::string& path, const PanopticDataset& data) {
  if (path.empty()) return std::nullopt;
  dataset::Split split = dataset::ReadSplit(path);
  dataset::RequireSplitOf(split, data, path);
  return split;
}

void AddSamples(const DatasetSourceOptions& options, int person, const std::optional<dataset::Split>& split,
                DatasetSource* source) {
  const PanopticDataset& data = source->data();
  const std::vector<std::string> names = geometry::CameraNames(data.rig);
  const std::vector<int> frames = FramesOf(data, person);
  const auto missing = dataset::FindMissing(data, names, frames, options.masks);
  for (const int frame : frames) {
    for (size_t c = 0; c < names.size(); ++c) {
      if (missing.Has(names[c], frame)) continue;
      const dataset::PartOfSplit part = split ? dataset::PartOf(*split, names[c], frame) : dataset::PartOfSplit::kNone;
      if (split && part == dataset::PartOfSplit::kNone) continue;
      std::optional<PackSample> sample = SampleAt(*source, c, frame, person);
      if (!sample) continue;
      sample->part = part, sample->has_mask = options.masks;
      source->Add(std::move(*sample));
    }
  }
  if (source->samples().empty()) {
    const std::string why = missing.missing() > 0 ? "; " + dataset::MissingText(missing) : "";
    throw FormatError(
        data.root, "",
        "has no image" + std::string(options.masks ? " with a mask" : "") + " of person " + std::to_string(person) + why);
  }
}

}  // namespace

std::shared_ptr<SampleSource> OpenPackSource(const std::string& path, bool check) {
  dataset::PackOpenOptions options;
  options.check_in_child = check;
  return std::make_shared<PackSource>(dataset::OpenPack(path, options));
}

std::shared_ptr<SampleSource> OpenDatasetSource(const std::string& folder, const DatasetSourceOptions& options) {
  RequireSane(options);
  PanopticDataset data = dataset::OpenPanopticDataset(folder);
  const std::optional<dataset::Split> split = SplitOf(options.split, data);
  const std::map<int, double> extents = dataset::LargeExtents(data);
  const int person = options.person >= 0 ? options.person : dataset::MostSeenPerson(data);
  const auto extent = extents.find(person);
  if (extent == extents.end())
    throw FormatError(
        folder, "",
        person < 0 ? "no frame has a person in it" : "no camera has person " + std::to_string(person) + " in front of it");
  const double half_extent_m = options.half_extent_m > 0 ? options.half_extent_m : extent->second;
  auto source = std::make_shared<DatasetSource>(std::move(data), options, half_extent_m);
  AddSamples(options, person, split, source.get());
  return source;
}

}  // namespace mvstudio::python
