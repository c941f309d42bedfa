#include "avatar/nets/model.h"

#include <torch/torch.h>

#include <algorithm>
#include <sstream>
#include <vector>

#include "avatar/maps/camera_tensor.h"
#include "avatar/maps/template_maps.h"
#include "avatar/maps/texture.h"
#include "avatar/nets/neural_texture.h"
#include "avatar/nets/reference_renderer.h"
#include "core/check.h"
#include "core/error.h"
#include "core/format.h"

namespace mvstudio::avatar {
namespace {

constexpr const char* kFormat = "mvstudio.avatar/1";

/// Parameters and running statistics of the network by name.
std::map<std::string, at::Tensor> NetworkTensors(const AvatarModel& model) {
  std::map<std::string, at::Tensor> tensors;
  for (const auto& item : model.generator->named_parameters()) tensors["generator." + item.key()] = item.value();
  for (const auto& item : model.generator->named_buffers()) tensors["generator." + item.key()] = item.value();
  return tensors;
}

double NumberFrom(const TensorFile& file, const std::string& key, const std::string& path) {
  const auto found = file.metadata.find(key);
  if (found == file.metadata.end()) throw FormatError(path, "__metadata__." + key, "is missing: not an avatar checkpoint");
  std::istringstream in(found->second);
  double value = 0;
  in >> value;
  if (in.fail() || !in.eof()) throw FormatError(path, "__metadata__." + key, "'" + found->second + "' is not a number");
  return value;
}

void CopyInto(at::Tensor target, const TensorFile& file, const std::string& name, const std::string& path) {
  const auto found = file.tensors.find(name);
  if (found == file.tensors.end()) throw FormatError(path, name, "is missing: the checkpoint does not fit its options");
  if (found->second.sizes() != target.sizes() || found->second.scalar_type() != target.scalar_type()) {
    throw FormatError(path, name, "has another shape or type than its options say");
  }
  if (target.is_floating_point() && !at::isfinite(found->second).all().item<bool>())
    throw FormatError(path, name, "is not finite");
  target.copy_(found->second);
}

at::Tensor Background(const at::Tensor& background, const at::Tensor& like) {
  return background.defined() ? background.to(like.options()) : at::zeros({3}, like.options());
}

void CheckPoses(const at::Tensor& joints_in_cam, const at::Tensor& valid, const at::Tensor& intrinsics) {
  const int64_t batch = joints_in_cam.size(0), joints = joints_in_cam.size(1);
  MVS_CHECK(IsJointList(joints) && joints_in_cam.sizes() == at::IntArrayRef({batch, joints, 3}) &&
                valid.sizes() == at::IntArrayRef({batch, joints}) && intrinsics.sizes() == at::IntArrayRef({batch, 4}),
            "joints_in_cam must be (B, J, 3) with J = 19, 25, 131 or 137, valid (B, J), intrinsics (B, 4); they are "
                << joints_in_cam.sizes() << ", " << valid.sizes() << ", " << intrinsics.sizes());
}

/// Removes faint haze: where the person's probability is below 5 % the image is the background, above 95 % the person
/// alone, with a continuous transition. Otherwise a trace of a per mille over a flat background would ruin all structural
/// scores.
at::Tensor CleanMatte(const at::Tensor& image, const at::Tensor& mask_prob, const at::Tensor& background) {
  const at::Tensor alpha = mask_prob.unsqueeze(1), base = background.view({1, 3, 1, 1});
  return base + (image - base) * (CleanAlpha(alpha) / alpha.clamp_min(1e-6));
}

/// What the network sees of the past; undefined for methods that see none.
at::Tensor PreviousOrBlack(const AvatarModel& model, const at::Tensor& previous, const at::Tensor& maps) {
  const int channels = NumPreviousChannels(model.options);
  if (channels == 0) return {};
  if (!previous.defined()) return at::zeros({maps.size(0), channels, maps.size(2), maps.size(3)}, maps.options());
  MVS_CHECK(previous.dim() == 4 && previous.size(0) == maps.size(0) && previous.size(1) == channels,
            "previous images of sizes " << previous.sizes());
  return previous.to(maps.options());
}

/// Share of an image that is not carried over from the one before, by the network's weight logit. Of a network that starts
/// from the template in colours an output of 0 carries nothing.
at::Tensor FreshShare(const at::Tensor& logit, bool from_template) {
  if (!from_template) return at::sigmoid(logit);
  constexpr double kAtZero = 4;
  return 1 - (at::sigmoid(logit - kAtZero) - at::sigmoid(at::full_like(logit, -kAtZero)));
}

/// Half precision ends with the convolutions; double stays, where a network is checked in it.
at::Tensor AtLeastSingle(const at::Tensor& x) { return x.scalar_type() == at::kDouble ? x : x.to(at::kFloat); }

/// Most likely part and its coordinates.
void FillParts(const at::Tensor& logits, const at::Tensor& uv, Rendering* out) {
  const at::Tensor part = (logits.slice(1, 1).argmax(1) + 1) * (out->mask_prob > 0.5);
  const at::Tensor channel = (part - 1).clamp_min(0).unsqueeze(1);
  const at::Tensor chosen = at::cat({uv.slice(1, 0, 24).gather(1, channel), uv.slice(1, 24, 48).gather(1, channel)}, 1);
  out->part = part.to(at::kByte);
  out->uv = (0.5 * chosen + 0.5).clamp(0, 1) * (part > 0).unsqueeze(1);
}

/// What the options are valid for while those of the body are not known yet.
ModelOptions WithoutBody(ModelOptions options) {
  if (options.method == Method::kHf) options.method = Method::kDirect;
  return options;
}

/// The joints' bones as the options lay them out.
void AddBoneMaps(const AvatarModel& model, const at::Tensor& joints_in_cam, const at::Tensor& valid,
                 const at::Tensor& joints_px, int64_t height, int64_t width, std::vector<at::Tensor>* maps) {
  const InputLayout& layout = LayoutOf(model.options.inputs);
  MVS_CHECK(
      NumBodyJoints(joints_px.size(1)) == NumBodyJoints(layout.num_joints),
      "a network with " << model.options.inputs << " inputs takes joints of a body of " << NumBodyJoints(layout.num_joints));
  const double half_width = BoneHalfWidth(model.options.bone_half_width_px, std::max(height, width));
  const at::Tensor depth = BoneDepth(joints_in_cam, valid, model.options.relative_depth);
  maps->push_back(RasterizeMaps(layout.maps, joints_px, depth, valid, height, width, half_width, model.depth));
  if (layout.slopes) maps->push_back(RasterizeSlopes(joints_px, joints_in_cam, valid, height, width, half_width));
}

}  // namespace

AvatarModel MakeModel(const ModelOptions& options, int size_px, const DepthRange& depth, uint64_t seed) {
  Validate(options);
  MVS_CHECK(depth.far_m > depth.near_m, "empty depth range " << depth.near_m << ".." << depth.far_m);
  AvatarModel model;
  model.options = options;
  if (options.texture_px == 0) model.options.texture_px = std::max(8, size_px * 3 / 8);
  model.depth = depth;
  model.size_px = size_px;
  model.generator = Generator(options, seed);
  if (options.method == Method::kTna) {
    const int64_t size = model.options.texture_px;
    model.textures = at::zeros({24, 3, size, size}, at::kFloat).requires_grad_();
    model.seen = at::zeros({24, size, size}, at::kFloat);
  }
  if (options.method == Method::kHf) {
    const int64_t size = model.options.texture_px;
    model.textures = at::zeros({24, 3, size, size}, at::kFloat);
    model.learned = at::zeros({24, options.neural_channels - 3, size, size}, at::kFloat).requires_grad_();
  }
  return model;
}

void SetBodyTextures(AvatarModel& model, const at::Tensor& textures) {
  MVS_CHECK(model.options.method == Method::kHf && textures.dim() == 4 && textures.size(0) == 24 && textures.size(1) == 3,
            "a body's textures are (24, 3, S, S), they are " << textures.sizes());
  const int64_t size = model.options.texture_px;
  const at::Tensor resampled =
      textures.size(2) == size ? textures : at::_upsample_bilinear2d_aa(textures, {size, size}, /*align_corners=*/false);
  model.textures = resampled.to(model.textures.options()).clone();
}

at::Tensor NetworkInput(const AvatarModel& model, const at::Tensor& joints_in_cam, const at::Tensor& valid,
                        const at::Tensor& joints_px, int64_t height, int64_t width, const TemplateView& seen) {
  std::vector<at::Tensor> maps;
  if (NumBoneChannels(model.options) > 0) AddBoneMaps(model, joints_in_cam, valid, joints_px, height, width, &maps);
  MVS_CHECK(seen.maps.defined() == (NumTemplateChannels(model.options) > 0),
            "a network with prior " << ToString(model.options.prior) << (seen.maps.defined() ? " takes no" : " needs")
                                    << " template maps");
  const bool colours = CorrectsColours(model.options);
  MVS_CHECK(seen.colours.defined() || !colours, "a network that corrects the template's colours needs them");
  if (seen.maps.defined()) maps.push_back(TemplateChannels(seen.maps, colours ? seen.colours : at::Tensor()));
  if (!TakesReferences(model.options)) return maps.size() == 1 ? maps[0] : at::cat(maps, 1);
  MVS_CHECK(seen.references.defined(), "a network that takes references needs them");
  maps.push_back(seen.references.to(maps[0].options()));
  return at::cat(maps, 1);
}

at::Tensor RendererInput(const AvatarModel& model, const at::Tensor& maps) {
  constexpr int64_t kParts = 24, kFirstPart = 3, kFirstColour = kFirstPart + kParts;
  const at::Tensor cover = maps.slice(1, 0, 1), colours = maps.slice(1, kFirstColour, kFirstColour + 3);
  const at::Tensor texture = at::cat({model.textures, model.learned}, 1);
  const at::Tensor sampled = SampleCharts(texture, maps.slice(1, kFirstPart, kFirstColour), maps.slice(1, 1, kFirstPart));
  return at::cat({cover * sampled, cover * colours, cover, maps.slice(1, kFirstColour + 3)}, 1);
}

std::pair<at::Tensor, at::Tensor> Predict(AvatarModel& model, const at::Tensor& maps, const at::Tensor& previous) {
  const at::Tensor input = previous.defined()                    ? at::cat({maps, previous}, 1)
                           : model.options.method == Method::kHf ? RendererInput(model, maps)
                                                                 : maps;
  auto [first, second] = model.generator->forward(input);
  first = AtLeastSingle(first), second = AtLeastSingle(second);
  const int64_t bones = NumBoneChannels(model.options), channels = NumTemplateChannels(model.options);
  if (channels > 0) AddTemplate(model.options, maps.slice(1, bones, bones + channels), &first, &second);
  return {first, second};
}

at::Tensor Warp(const at::Tensor& images, const at::Tensor& flow_px) {
  const int64_t height = images.size(2), width = images.size(3);
  const at::Tensor x = at::arange(width, flow_px.options()).view({1, 1, width}) + flow_px.select(1, 0);
  const at::Tensor y = at::arange(height, flow_px.options()).view({1, height, 1}) + flow_px.select(1, 1);
  const at::Tensor grid = at::stack({(2 * x + 1) / width - 1, (2 * y + 1) / height - 1}, 3);
  return at::grid_sampler(images, grid, /*bilinear*/ 0, /*border*/ 1, /*align_corners=*/false);
}

at::Tensor FlowOf(const at::Tensor& second_head) { return 20 * second_head.slice(1, 3, 5); }

at::Tensor ComposeImage(const AvatarModel& model, const at::Tensor& first_head, const at::Tensor& second_head,
                        const at::Tensor& background, const at::Tensor& previous) {
  if (model.options.method == Method::kTna) {
    return SampleTextures(model.textures, at::softmax(first_head, 1), CoordinatesOf(model.options, second_head), background);
  }
  const bool corrected = CorrectsColours(model.options);
  at::Tensor colour = corrected ? second_head.slice(1, 0, 3) : 0.5 * at::tanh(second_head.slice(1, 0, 3)) + 0.5;
  if (model.options.method == Method::kV2v) {
    const at::Tensor fresh = FreshShare(second_head.slice(1, 5, 6), corrected);
    colour = fresh * colour + (1 - fresh) * Warp(previous.slice(1, 0, 3), FlowOf(second_head));
  }
  const at::Tensor person = at::sigmoid(first_head);
  return person * colour + (1 - person) * background.view({1, 3, 1, 1});
}

at::Tensor PersonProbability(const AvatarModel& model, const at::Tensor& first_head) {
  return model.options.method == Method::kTna ? 1 - at::softmax(first_head, 1).select(1, 0)
                                              : at::sigmoid(first_head).squeeze(1);
}

at::Tensor CleanImage(const AvatarModel& model, const at::Tensor& first_head, const at::Tensor& second_head,
                      const at::Tensor& background, const at::Tensor& previous) {
  return CleanMatte(ComposeImage(model, first_head, second_head, background, previous), PersonProbability(model, first_head),
                    background);
}

Rendering Render(AvatarModel& model, const PoseBatch& poses, int64_t height, int64_t width, const at::Tensor& background,
                 const at::Tensor& previous) {
  torch::NoGradGuard no_grad;
  model.generator->eval();
  const at::Tensor like = model.generator->parameters()[0];
  CheckPoses(poses.joints_in_cam, poses.joint_valid, poses.intrinsics);
  const at::Tensor joints_px = ProjectPinhole(poses.intrinsics, poses.joints_in_cam);
  const at::Tensor maps =
      NetworkInput(model, poses.joints_in_cam, poses.joint_valid, joints_px, height, width, poses.body).to(like.device());
  const at::Tensor before = PreviousOrBlack(model, previous, maps);
  const auto [first, second] = Predict(model, maps, before);
  const at::Tensor behind = Background(background, like);
  Rendering out;
  out.mask_prob = PersonProbability(model, first);
  out.image = CleanImage(model, first, second, behind, before).clamp(0, 1).to(at::kCPU).contiguous();
  if (model.options.method == Method::kTna) {
    FillParts(first, CoordinatesOf(model.options, second), &out);
  } else {
    out.part = (out.mask_prob > 0.5).to(at::kByte);
    out.uv = at::zeros({maps.size(0), 2, height, width}, like.options());
  }
  out.mask_prob = out.mask_prob.to(at::kCPU), out.part = out.part.to(at::kCPU), out.uv = out.uv.to(at::kCPU);
  return out;
}

TensorFile ModelToTensors(const AvatarModel& model) {
  TensorFile file;
  file.tensors = NetworkTensors(model);
  if (model.textures.defined()) {
    file.tensors["textures"] = model.textures;
    if (model.seen.defined()) file.tensors["textures_seen"] = model.seen;
  }
  if (model.learned.defined()) file.tensors["neural_textures"] = model.learned;
  for (auto& [name, tensor] : file.tensors) tensor = tensor.detach().to(at::kCPU).clone();
  file.metadata["format"] = kFormat;
  for (const auto& [name, value] : FieldsAsText(model.options)) file.metadata["model." + name] = value;
  file.metadata["depth_near_m"] = Format("%.17g", model.depth.near_m);
  file.metadata["depth_far_m"] = Format("%.17g", model.depth.far_m);
  file.metadata["size_px"] = std::to_string(model.size_px);
  file.metadata["step"] = std::to_string(model.step);
  return file;
}

ModelOptions ModelOptionsFrom(const TensorFile& file, const std::string& path) {
  ModelOptions options = OptionsOfOlderRuns();
  for (const auto& [name, value] : FieldsAsText(options)) {
    const auto found = file.metadata.find("model." + name);
    if (found == file.metadata.end()) continue;
    try {
      SetFieldFromText(options, name, found->second);
      Validate(WithoutBody(options));
    } catch (const UsageError& error) {
      throw FormatError(path, "__metadata__.model." + name, error.what());
    }
  }
  try {
    Validate(options);
  } catch (const UsageError& error) {
    throw FormatError(path, "__metadata__.model.method", error.what());
  }
  return options;
}

AvatarModel ModelFromTensors(const TensorFile& file, const std::string& path) {
  const auto format = file.metadata.find("format");
  if (format == file.metadata.end() || format->second != kFormat) {
    throw FormatError(path, "__metadata__.format", "is not an avatar checkpoint of this version");
  }
  const DepthRange depth = {NumberFrom(file, "depth_near_m", path), NumberFrom(file, "depth_far_m", path)};
  if (!(depth.far_m > depth.near_m)) throw FormatError(path, "__metadata__.depth_far_m", "is not behind depth_near_m");
  AvatarModel model = MakeModel(ModelOptionsFrom(file, path), static_cast<int>(NumberFrom(file, "size_px", path)), depth, 0);
  model.step = static_cast<int64_t>(NumberFrom(file, "step", path));
  torch::NoGradGuard no_grad;
  for (auto& [name, tensor] : NetworkTensors(model)) CopyInto(tensor, file, name, path);
  if (model.textures.defined()) {
    CopyInto(model.textures, file, "textures", path);
    if (model.seen.defined()) CopyInto(model.seen, file, "textures_seen", path);
  }
  if (model.learned.defined()) CopyInto(model.learned, file, "neural_textures", path);
  return model;
}

AvatarModel LoadModel(const std::string& path) { return ModelFromTensors(ReadTensorFile(path), path); }

at::Tensor TextureSheet(const AvatarModel& model) {
  MVS_CHECK(model.textures.defined(), "method " << ToString(model.options.method) << " has no textures");
  const int64_t size = model.options.texture_px;
  const at::Tensor colours = (model.textures.detach().to(at::kCPU) * 127.5 + 127.5).round().clamp(0, 255).to(at::kByte);
  return colours.view({4, 6, 3, size, size}).permute({2, 0, 3, 1, 4}).reshape({3, 4 * size, 6 * size}).contiguous();
}

}  // namespace mvstudio::avatar
