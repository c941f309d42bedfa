#include "avatar/run/references/reference_views.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <sstream>

#include "avatar/data/safetensors.h"
#include "avatar/run/pack/pack_rows.h"
#include "core/check.h"
#include "core/error.h"

namespace mvstudio::avatar {
namespace {

constexpr char kFormat[] = "mvstudio.avatar_references/1";
constexpr int64_t kCameraNumbers = 11;  // fx, fy, cx, cy; rotation x, y, z, w; translation

/// Image -> (channels, H, W) uint8.
at::Tensor ToTensor(const Image& image) {
  at::Tensor hwc = at::zeros({image.height, image.width, image.channels}, at::kByte);
  std::copy(image.pixels.begin(), image.pixels.end(), hwc.data_ptr<uint8_t>());
  return hwc.permute({2, 0, 1}).contiguous();
}

at::Tensor NumbersOf(const geometry::RigCamera& crop) {
  const Eigen::Vector4d q = crop.cam_from_world.rotation.coeffs();
  const Eigen::Vector3d& t = crop.cam_from_world.translation;
  const Eigen::VectorXd& p = crop.camera.params;
  return at::tensor({p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3], t[0], t[1], t[2]}, at::kDouble);
}

geometry::RigCamera CameraOf(const double* n, const std::string& name, int size_px) {
  geometry::RigCamera crop;
  crop.camera = geometry::MakePinhole(name, size_px, size_px, n[0]);
  for (int k = 0; k < 4; ++k) crop.camera.params[k] = n[k];
  crop.cam_from_world.rotation = Eigen::Quaterniond(Eigen::Vector4d(n[4], n[5], n[6], n[7]));
  crop.cam_from_world.translation = Eigen::Vector3d(n[8], n[9], n[10]);
  return crop;
}

/// The tensor of that name, which must have the type and the sizes, and be finite.
at::Tensor Take(const TensorFile& file, const std::string& name, at::ScalarType type, at::IntArrayRef sizes,
                const std::string& path) {
  const auto found = file.tensors.find(name);
  if (found == file.tensors.end()) throw FormatError(path, name, "is missing");
  const at::Tensor& tensor = found->second;
  if (tensor.scalar_type() != type || tensor.sizes() != sizes) throw FormatError(path, name, "has another type or other sizes");
  constexpr double kFarthest = 1e6;
  if (tensor.is_floating_point() && !tensor.abs().lt(kFarthest).all().item<bool>())
    throw FormatError(path, name, "has numbers that are not finite or far beyond any studio");
  return tensor.contiguous();
}

void CheckCameras(const at::Tensor& cameras, const std::string& path) {
  const bool focal = cameras.slice(1, 0, 2).gt(0).all().item<bool>();
  const bool unit = (cameras.slice(1, 4, 8).square().sum(1) - 1).abs().lt(1e-9).all().item<bool>();
  if (!focal || !unit) throw FormatError(path, "cameras", "has a focal length or a rotation that is none");
}

/// Only training images may be seen by others.
void CheckTrained(const ReferenceView& view, const DatasetSplit& split, const std::string& path) {
  const auto& cameras = split.train_cameras;
  const auto& frames = split.train_frames;
  if (std::find(cameras.begin(), cameras.end(), view.camera) == cameras.end())
    throw FormatError(path, "camera_names", "camera " + view.camera + " was not trained on");
  if (std::find(frames.begin(), frames.end(), view.frame) == frames.end())
    throw FormatError(path, "frame", "frame " + std::to_string(view.frame) + " was not trained on");
}

std::vector<std::string> NamesOf(const TensorFile& file) {
  const auto text = file.metadata.find("camera_names");
  std::vector<std::string> names;
  std::istringstream lines(text == file.metadata.end() ? "" : text->second);
  for (std::string line; std::getline(lines, line);) names.push_back(line);
  return names;
}

}  // namespace

std::vector<ReferenceView> SpreadReferenceViews(const AvatarPack& pack, const std::vector<RowView>& views) {
  MVS_CHECK(static_cast<int64_t>(views.size()) == pack.size(), views.size() << " views of " << pack.size() << " images");
  const int64_t total = pack.size(), count = std::min<int64_t>(total, kMostReferenceViews);
  std::vector<ReferenceView> out;
  for (int64_t k = 0; k < count; ++k) {
    const int64_t i = (2 * k + 1) * total / (2 * count);
    ReferenceView view;
    view.camera = pack.cameras[pack.camera_idx[i].item<int64_t>()];
    view.frame = static_cast<int>(pack.frame[i].item<int64_t>());
    view.crop = views[static_cast<size_t>(i)].crop, view.vertices = views[static_cast<size_t>(i)].vertices;
    view.image = ImageOfBytes(pack.images[i]), view.mask = ImageOfBytes(pack.masks[i].unsqueeze(0));
    out.push_back(std::move(view));
  }
  return out;
}

void WriteReferenceViews(const std::vector<ReferenceView>& views, const std::string& path) {
  MVS_CHECK(!views.empty(), "no image to refer to");
  std::vector<at::Tensor> images, masks, cameras, vertices;
  std::vector<int64_t> frames;
  TensorFile file;
  for (const ReferenceView& view : views) {
    images.push_back(ToTensor(view.image)), masks.push_back(ToTensor(view.mask)[0]), cameras.push_back(NumbersOf(view.crop));
    at::Tensor columns = at::zeros({view.vertices->cols(), 3}, at::kFloat);
    std::copy_n(view.vertices->data(), columns.numel(), columns.data_ptr<float>());
    vertices.push_back(columns);
    frames.push_back(view.frame);
    file.metadata["camera_names"] += view.camera + "\n";
  }
  file.metadata["format"] = kFormat;
  file.tensors = {{"images", at::stack(images)},
                  {"masks", at::stack(masks)},
                  {"cameras", at::stack(cameras)},
                  {"vertices", at::stack(vertices)},
                  {"frame", at::tensor(frames, at::kLong)}};
  WriteTensorFile(file, path);
}

std::vector<ReferenceView> ReadReferenceViews(const std::string& path, const DatasetSplit& split, int64_t num_vertices) {
  const TensorFile file = ReadTensorFile(path);
  const auto format = file.metadata.find("format");
  if (format == file.metadata.end() || format->second != kFormat)
    throw FormatError(path, "__metadata__.format", std::string("is not ") + kFormat);
  const std::vector<std::string> names = NamesOf(file);
  const auto count = static_cast<int64_t>(names.size());
  if (count < 1 || count > kMostReferenceViews)
    throw FormatError(path, "__metadata__.camera_names", "must name 1 to " + std::to_string(kMostReferenceViews) + " images");
  const auto found = file.tensors.find("images");
  if (found == file.tensors.end() || found->second.dim() != 4) throw FormatError(path, "images", "is missing or no images");
  const int64_t size = found->second.size(3);
  if (size < 2 || size > 4096) throw FormatError(path, "images", "must be 2 to 4096 px wide");
  const at::Tensor images = Take(file, "images", at::kByte, {count, 3, size, size}, path);
  const at::Tensor masks = Take(file, "masks", at::kByte, {count, size, size}, path);
  const at::Tensor cameras = Take(file, "cameras", at::kDouble, {count, kCameraNumbers}, path);
  const at::Tensor vertices = Take(file, "vertices", at::kFloat, {count, num_vertices, 3}, path);
  const at::Tensor frames = Take(file, "frame", at::kLong, {count}, path);
  CheckCameras(cameras, path);
  std::vector<ReferenceView> views(names.size());
  for (int64_t i = 0; i < count; ++i) {
    ReferenceView& view = views[static_cast<size_t>(i)];
    view.camera = names[static_cast<size_t>(i)];
    view.frame = static_cast<int>(frames.data_ptr<int64_t>()[i]);
    CheckTrained(view, split, path);
    view.crop = CameraOf(cameras.data_ptr<double>() + i * kCameraNumbers, view.camera, static_cast<int>(size));
    Eigen::Matrix3Xf columns(3, num_vertices);
    std::copy_n(vertices.data_ptr<float>() + i * 3 * num_vertices, columns.size(), columns.data());
    view.vertices = std::make_shared<const Eigen::Matrix3Xf>(std::move(columns));
    view.image = ImageOfBytes(images[i]), view.mask = ImageOfBytes(masks[i].unsqueeze(0));
  }
  return views;
}

}  // namespace mvstudio::avatar
