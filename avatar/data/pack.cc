#include "avatar/data/pack.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <sstream>

#include "avatar/data/safetensors.h"
#include "avatar/maps/bone_lists.h"
#include "avatar/maps/template_maps.h"
#include "core/check.h"
#include "core/error.h"

namespace mvstudio::avatar {
namespace {

constexpr const char* kFormat = "mvstudio.avatar_pack/1";

constexpr int64_t kSize = -1, kJoints = -2, kNetworkSize = -3;

struct Field {
  const char* name;
  at::Tensor AvatarPack::*tensor;
  at::ScalarType type;
  std::vector<int64_t> tail;  // sizes after N; kSize stands for the image size, kJoints for the number of joints
  bool optional = false;
};

const std::vector<Field>& Fields() {
  static const std::vector<Field> fields = {
      {"images", &AvatarPack::images, at::kByte, {3, kSize, kSize}},
      {"masks", &AvatarPack::masks, at::kByte, {kSize, kSize}},
      {"joints_in_cam", &AvatarPack::joints_in_cam, at::kFloat, {kJoints, 3}},
      {"joint_valid", &AvatarPack::joint_valid, at::kBool, {kJoints}},
      {"intrinsics", &AvatarPack::intrinsics, at::kFloat, {4}},
      {"part", &AvatarPack::part, at::kByte, {kSize, kSize}},
      {"uv", &AvatarPack::uv, at::kFloat, {2, kSize, kSize}},
      {"template_maps", &AvatarPack::template_maps, at::kFloat, {kTemplateMaps, kNetworkSize, kNetworkSize}, true},
      {"template_colours", &AvatarPack::template_colours, at::kByte, {3, kNetworkSize, kNetworkSize}, true},
      {"references", &AvatarPack::references, at::kByte, {4, kNetworkSize, kNetworkSize}, true},
      {"body_images", &AvatarPack::body_images, at::kByte, {4, kSize, kSize}, true},
      {"camera_idx", &AvatarPack::camera_idx, at::kLong, {}},
      {"frame", &AvatarPack::frame, at::kLong, {}}};
  return fields;
}

void CheckShapes(const AvatarPack& pack) {
  MVS_CHECK(pack.size_px > 0 && pack.images.defined(), "the pack is empty");
  const bool has_joints = pack.joint_valid.defined() && pack.joint_valid.dim() == 2;
  const int64_t num_joints = has_joints ? pack.joint_valid.size(1) : kNumJoints;
  MVS_CHECK(IsJointList(num_joints), num_joints << " joints; lists have 19, 25, 131 or 137");
  for (const Field& field : Fields()) {
    const at::Tensor& tensor = pack.*field.tensor;
    if (field.optional && !tensor.defined()) continue;
    const int64_t network_px = tensor.defined() && tensor.dim() > 0 ? tensor.size(-1) : 0;
    std::vector<int64_t> shape = {pack.size()};
    for (const int64_t size : field.tail)
      shape.push_back(size == kSize ? pack.size_px : size == kJoints ? num_joints : size == kNetworkSize ? network_px : size);
    MVS_CHECK(tensor.defined() && tensor.device().is_cpu() && tensor.scalar_type() == field.type &&
                  tensor.sizes() == at::IntArrayRef(shape),
              field.name << " must be " << at::IntArrayRef(shape) << " " << field.type << " on the CPU, it is "
                         << (tensor.defined() ? tensor.toString() : "missing") << " "
                         << (tensor.defined() ? tensor.sizes() : at::IntArrayRef()));
  }
}

/// `good` (N, ...) bool: names the first image with a false.
void RequireEach(const AvatarPack& pack, const at::Tensor& good, const char* what) {
  const at::Tensor rows = good.reshape({pack.size(), -1}).all(1);
  if (rows.all().item<bool>()) return;
  const int64_t i = rows.logical_not().nonzero()[0].item<int64_t>();
  MVS_CHECK(false, ImageName(pack, i) << ": " << what);
}

}  // namespace

PoseBatch PosesOf(const AvatarPack& pack) { return PosesOf(pack, at::arange(pack.joint_valid.size(0), at::kLong)); }

PoseBatch PosesOf(const AvatarPack& pack, const at::Tensor& rows) {
  const auto of = [&](const at::Tensor& t) { return t.defined() ? t.index_select(0, rows) : at::Tensor(); };
  const auto share = [&](const at::Tensor& t) { return t.defined() ? of(t).to(at::kFloat) / 255 : at::Tensor(); };
  return {of(pack.joints_in_cam),
          of(pack.joint_valid),
          of(pack.intrinsics),
          {of(pack.template_maps), share(pack.template_colours), share(pack.references)}};
}

std::string ImageName(const AvatarPack& pack, int64_t i) {
  const int64_t camera = pack.camera_idx[i].item<int64_t>();
  const bool known = camera >= 0 && camera < static_cast<int64_t>(pack.cameras.size());
  return "camera " + (known ? pack.cameras[camera] : std::to_string(camera)) + ", frame " +
         std::to_string(pack.frame[i].item<int64_t>());
}

void Validate(const AvatarPack& pack) {
  CheckShapes(pack);
  MVS_CHECK(pack.size() > 0, "the pack holds no images");
  const auto num_cameras = static_cast<int64_t>(pack.cameras.size());
  MVS_CHECK(pack.frame_step >= 0 && std::is_sorted(pack.cuts.begin(), pack.cuts.end()), "frame_step or cuts are out of order");
  RequireEach(pack, (pack.camera_idx >= 0).logical_and(pack.camera_idx < num_cameras),
              "its camera is not in the list of cameras");
  RequireEach(pack, (pack.masks == 0).logical_or(pack.masks == 255), "the mask has values other than 0 and 255");
  RequireEach(pack, at::isfinite(pack.joints_in_cam), "a joint is not finite");
  RequireEach(pack, at::isfinite(pack.intrinsics), "the intrinsics are not finite");
  RequireEach(pack, pack.intrinsics.slice(1, 0, 2) > 0, "a focal length is not positive");
  RequireEach(pack, (pack.joints_in_cam.select(2, 2) > 0).logical_or(pack.joint_valid.logical_not()),
              "a valid joint is behind the camera");
  RequireEach(pack, pack.joint_valid.any(1), "no joint is valid");
  RequireEach(pack, pack.part <= kNumBodyParts, "the part map has values above 24");
  RequireEach(pack, (pack.uv >= 0).logical_and(pack.uv <= 1), "a texture coordinate is outside [0, 1] or not finite");
  if (pack.template_maps.defined()) {
    const at::Tensor rest = pack.template_maps.index_select(1, at::tensor({0, 2, 3})), part = pack.template_maps.select(1, 1);
    RequireEach(pack, (rest >= 0).logical_and(rest <= 1),
                "the template's cover or a coordinate is outside [0, 1] or not finite");
    RequireEach(pack, (part >= 0).logical_and(part <= kNumBodyParts).logical_and(part == part.round()),
                "the template's part is not one of 0..24");
  }
}

AvatarPack Select(const AvatarPack& pack, const std::vector<int64_t>& indices) {
  for (const int64_t i : indices) MVS_CHECK(i >= 0 && i < pack.size(), "image " << i << " of " << pack.size());
  AvatarPack out;
  out.size_px = pack.size_px;
  out.cameras = pack.cameras;
  out.frame_step = pack.frame_step, out.cuts = pack.cuts;
  const at::Tensor rows = at::tensor(indices, at::kLong);
  for (const Field& field : Fields()) {
    if ((pack.*field.tensor).defined()) out.*field.tensor = (pack.*field.tensor).index_select(0, rows);
  }
  return out;
}

void SavePack(const AvatarPack& pack, const std::string& path) {
  Validate(pack);
  TensorFile file;
  for (const Field& field : Fields()) {
    if ((pack.*field.tensor).defined()) file.tensors[field.name] = pack.*field.tensor;
  }
  file.metadata["format"] = kFormat;
  file.metadata["size_px"] = std::to_string(pack.size_px);
  for (const std::string& camera : pack.cameras) file.metadata["cameras"] += camera + "\n";
  if (pack.frame_step > 0) file.metadata["frame_step"] = std::to_string(pack.frame_step);
  for (const int64_t cut : pack.cuts) file.metadata["cuts"] += std::to_string(cut) + "\n";
  WriteTensorFile(file, path);
}

AvatarPack LoadPack(const std::string& path) {
  TensorFile file = ReadTensorFile(path);
  if (file.metadata["format"] != kFormat)
    throw FormatError(path, "__metadata__", "is not an avatar pack: build one from a dataset");
  AvatarPack pack;
  for (const Field& field : Fields()) {
    const auto found = file.tensors.find(field.name);
    if (found == file.tensors.end() && !field.optional) throw FormatError(path, field.name, "is missing");
    if (found != file.tensors.end()) pack.*field.tensor = found->second;
  }
  std::istringstream lines(file.metadata["cameras"]);
  for (std::string line; std::getline(lines, line);) pack.cameras.push_back(line);
  std::istringstream(file.metadata["size_px"]) >> pack.size_px;
  std::istringstream(file.metadata["frame_step"]) >> pack.frame_step;
  std::istringstream numbers(file.metadata["cuts"]);
  for (int64_t cut = 0; numbers >> cut;) pack.cuts.push_back(cut);
  try {
    Validate(pack);
  } catch (const ContractViolation& error) {
    throw FormatError(path, "", error.what());
  }
  return pack;
}

}  // namespace mvstudio::avatar
