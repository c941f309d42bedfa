#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <string>
#include <utility>

#include "avatar/data/pack.h"
#include "avatar/data/safetensors.h"
#include "avatar/maps/bones.h"
#include "avatar/nets/generator.h"
#include "avatar/settings/options.h"

namespace mvstudio::avatar {

/// A trained (or new) avatar: everything that rendering needs.
struct AvatarModel {
  ModelOptions options;
  DepthRange depth;
  int size_px = 0;   ///< image size it was trained at
  int64_t step = 0;  ///< training steps done, initialisation included
  Generator generator{nullptr};
  at::Tensor textures;  ///< (24, 3, S, S) float32, about [-1, 1]; `hf`: of the fitted body, frozen; undefined for `direct`
  at::Tensor learned;   ///< (24, C - 3, S, S) float32, `hf` alone: the other channels of its neural texture, from 0
  at::Tensor seen;  ///< (24, S, S) float32: how often a texel was seen when textures were averaged; 0: filled from neighbours
};

/// New weights: convolutions N(0, 0.02), grey textures (their size follows `size_px` where the options do not set it).
AvatarModel MakeModel(const ModelOptions& options, int size_px, const DepthRange& depth, uint64_t seed);

/// Colours of a fitted body, one (3, S', S') image in [-1, 1] a part, as the frozen channels of `hf`: resampled to its texels.
void SetBodyTextures(AvatarModel& model, const at::Tensor& textures);

/// Network input for a batch of poses: joints_in_cam (B, J, 3) metres, valid (B, J), joints_px (B, J, 2) -> (B, inputs, H,
/// W), without bones for `hf`. Where the template is the prior, the channels of `seen` follow; it must be given then, and only
/// then. J includes the body that the inputs need (bone_lists.h); where J has no hands and face, their maps are background.
at::Tensor NetworkInput(const AvatarModel& model, const at::Tensor& joints_in_cam, const at::Tensor& valid,
                        const at::Tensor& joints_px, int64_t height, int64_t width, const TemplateView& seen = {});

/// What a ReferenceRenderer sees of such input: the neural texture on the body, the body's image, its cover, references.
/// Gradients reach `learned`.
at::Tensor RendererInput(const AvatarModel& model, const at::Tensor& maps);

/// The network's two outputs (see Generator) for such input; corrections to the template where that is the prior.
/// `previous`: as in ComposeImage.
std::pair<at::Tensor, at::Tensor> Predict(AvatarModel& model, const at::Tensor& maps, const at::Tensor& previous = {});

/// Blends the two outputs of Predict into an image (B, 3, H, W), with gradients; background (3) in [0, 1]. `previous`: the
/// previous images, only for `v2v` (B, 3 kNumPrevious, H, W), the latest first, on black.
at::Tensor ComposeImage(const AvatarModel& model, const at::Tensor& first_head, const at::Tensor& second_head,
                        const at::Tensor& background, const at::Tensor& previous = {});

/// The same as Render shows it, with gradients: where the person's probability is below 5 % the background, above 95 % the
/// person alone.
at::Tensor CleanImage(const AvatarModel& model, const at::Tensor& first_head, const at::Tensor& second_head,
                      const at::Tensor& background, const at::Tensor& previous = {});

/// Samples images at the positions of the flow (B, 2, H, W), x then y, px; borders are repeated outwards.
at::Tensor Warp(const at::Tensor& images, const at::Tensor& flow_px);

/// The flow of a `v2v` head, px: 20 times the network's output, as in vid2vid.
at::Tensor FlowOf(const at::Tensor& second_head);

struct Rendering {
  at::Tensor image;      ///< (B, 3, H, W) float32 in [0, 1], RGB
  at::Tensor mask_prob;  ///< (B, H, W) float32, probability of the person
  at::Tensor part;       ///< (B, H, W) uint8, most likely part where mask_prob > 0.5, else 0; all 1 on the person for `direct`
  at::Tensor uv;         ///< (B, 2, H, W) float32 in [0, 1], coordinates of that part, 0 on background
};

/// Renders poses; `background` (3) in [0, 1], black when undefined. No gradients are recorded; the image is clamped to [0,
/// 1], and pixels with less than 5 % person are background. H and W must be multiples of 2^downs. `previous`: as in
/// ComposeImage, of the same cameras' previous frames; undefined: none. Throws ContractViolation for shapes and for poses
/// that are not finite.
Rendering Render(AvatarModel& model, const PoseBatch& poses, int64_t height, int64_t width, const at::Tensor& background = {},
                 const at::Tensor& previous = {});

/// Converts a model to named tensors and metadata, and back. `path` is for messages.
TensorFile ModelToTensors(const AvatarModel& model);
AvatarModel ModelFromTensors(const TensorFile& file, const std::string& path);
/// Only the network's options.
ModelOptions ModelOptionsFrom(const TensorFile& file, const std::string& path);

/// Loads checkpoint.safetensors (or RUN/avatar's) for rendering. Throws IoError / FormatError.
AvatarModel LoadModel(const std::string& path);

/// 6 x 4 preview of the textures: (3, 4 S, 6 S) uint8 RGB.
at::Tensor TextureSheet(const AvatarModel& model);

}  // namespace mvstudio::avatar
