#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/choice/option_group.h"
#include "core/fields.h"

namespace mvstudio::avatar {

enum class Method {
  kTna,        ///< textured neural avatar
  kDirect,     ///< the same network, which predicts colours itself
  kV2v,        ///< that with memory, flow and discriminators
  kGaussians,  ///< no network: Gaussians on the fitted body (gaussian_options.h)
  kHf,         ///< reference-based neural rendering of the fitted body
};
/// Which training images an image of method `hf` may take its details from (avatar/run/references).
enum class ReferenceChoice {
  kBest,       ///< those that show most of what the image shows, in the most similar poses
  kFrontBack,  ///< the paper's: the person from the front and from the back
};
enum class NormLayer { kBatch, kInstance };
enum class Upsampling { kTransposed, kNearest };
/// What the network starts from.
enum class Prior {
  kNone,      ///< the bones alone
  kTemplate,  ///< the body template posed by the joints
  kAuto,      ///< to be chosen before there is a network
};
std::string_view ToString(Method method);           ///< "tna", "direct", "v2v", "gaussians", "hf"
std::string_view ToString(ReferenceChoice choice);  ///< "best", "frontback"
std::string_view ToString(NormLayer norm);          ///< "batch", "instance"
std::string_view ToString(Upsampling upsampling);   ///< "transposed", "nearest"
std::string_view ToString(Prior prior);             ///< "none", "template", "auto"
/// Throw UsageError.
void FromString(const std::string& text, Method* method);
void FromString(const std::string& text, ReferenceChoice* choice);
void FromString(const std::string& text, NormLayer* norm);
void FromString(const std::string& text, Upsampling* upsampling);
void FromString(const std::string& text, Prior* prior);

/// Architecture of the networks and size of the textures. The defaults suit a CPU; `PaperModel` gives the published sizes.
struct ModelOptions {
  Method method = Method::kTna;
  int width = 16;
  int downs = 4;
  int encoder_blocks = 4;
  int decoder_blocks = 3;
  NormLayer norm = NormLayer::kInstance;
  Upsampling upsample = Upsampling::kNearest;
  int stem_kernel = 5;
  int head_kernel = 3;
  bool skips = true;
  int inputs = 36;
  Prior prior = Prior::kNone;
  bool template_colours = true;
  bool spread_parts = true;
  int texture_px = 0;
  bool relative_depth = true;
  double bone_half_width_px = 12.0;
  int neural_channels = 16;
  int references = 4;
  ReferenceChoice reference_choice = ReferenceChoice::kBest;
  int reference_gap = 0;
};

template <class Visitor>
void VisitFields(Visitor&& visit, ModelOptions& o) {
  StartGroup(visit, "Network");
  visit("method", o.method,
        "tna: textured neural avatar; direct: the same network predicting colours itself; v2v: that with memory, flow and "
        "discriminators, the essentials of video-to-video translation (both are baselines); gaussians: no network, Gaussians "
        "on the fitted body; hf: a neural texture on the fitted body and training images warped onto it, rendered by a U-Net");
  visit("width", o.width, "channels of the first layer; the deepest layer has 8 times as many (the paper's network: 32)");
  visit("downs", o.downs, "stride-2 steps of the encoder; the image size must be a multiple of 2^downs");
  visit("encoder-blocks", o.encoder_blocks, "residual blocks of the encoder");
  visit("decoder-blocks", o.decoder_blocks, "residual blocks of each of the two decoders");
  visit("norm", o.norm, "batch or instance; instance has no running statistics and is safe for a batch of 1");
  visit("upsample", o.upsample, "transposed (4x4 transposed convolution) or nearest (nearest neighbour, then 3x3 convolution)");
  visit("stem-kernel", o.stem_kernel, "kernel of the first convolution, odd");
  visit("head-kernel", o.head_kernel, "kernel of the last convolutions, odd; 7 is the paper's, 3 is much faster");
  visit("skips", o.skips,
        "add the encoder's features to the decoders' at each size: learns much faster; the paper's network has none");
  StartGroup(visit, "Inputs of the network");
  visit("inputs", o.inputs,
        "input channels: 18 bones of Panoptic's joints with their depth; 21: and both hands and the face; 24: BODY_25's bones; "
        "27: and hands and face; 36: as 18, and the share of each bone that points away from the camera");
  visit(
      "prior", o.prior,
      "what the network starts from. template: the body template posed by the joints, whose outline, parts and coordinates are "
      "further inputs and are corrected by the network; none: the bones alone, as in the paper; auto (`avatar train` alone): "
      "template, or none with option 'iuv'");
  visit("template-colours", o.template_colours,
        "direct and v2v with option 'prior' template: the fitted body in its colours is a further input, and the network "
        "corrects that image; off: it learns the colours");
  StartGroup(visit, "Network");
  visit("spread-parts", o.spread_parts,
        "tna with option 'prior' template: at each pixel every part has coordinates, and a likelihood that falls with its "
        "distance, so that the network can move the parts' borders and coordinates; off: it holds the visible part fast");
  StartGroup(visit, "Textures");
  visit("texture-px", o.texture_px,
        "edge of each of the 24 textures, texels; 0: three eighths of the image size, finer ones stay noisy (the paper: 256 "
        "at 512 px)");
  StartGroup(visit, "Inputs of the network");
  visit("relative-depth", o.relative_depth,
        "bone depth relative to the body's centre, as suits person-centred crops; off: distance to the camera");
  visit("bone-half-width-px", o.bone_half_width_px,
        "half-width of a drawn bone in a 512 px image; scales with the image, at least 1 px (the paper: 4)");
  StartGroup(visit, "Method hf");
  visit("neural-channels", o.neural_channels,
        "hf: channels of the neural texture; the first three are the fitted body's colours and stay as they are");
  visit("references", o.references, "hf: training images of other time steps that are warped into each image; 0: none");
  visit("reference-choice", o.reference_choice,
        "hf: best (those that see most of what the image shows, in similar poses) or frontback (the person from the front and "
        "from the back, as in the paper)");
  visit("reference-gap", o.reference_gap,
        "hf: references are more than this many frame numbers away from the image; 0: any other time step");
}

/// Whether the network sees the fitted body in its colours and predicts corrections of that image.
bool CorrectsColours(const ModelOptions& options);

/// Whether the network sees training images that are warped into the image.
bool TakesReferences(const ModelOptions& options);

/// Whether the network corrects the parts and coordinates that the template gives at each pixel: the second output then holds
/// the coordinates themselves.
bool CorrectsParts(const ModelOptions& options);

/// What checkpoints mean that lack an option: they were made before there was one.
ModelOptions OptionsOfOlderRuns();

/// The published network: 17,167,552 parameters with 21 inputs.
inline ModelOptions PaperModel() {
  ModelOptions o;
  o.width = 32, o.norm = NormLayer::kBatch, o.upsample = Upsampling::kTransposed, o.inputs = 21, o.texture_px = 256;
  o.skips = false, o.stem_kernel = 7, o.head_kernel = 7, o.bone_half_width_px = 4;
  return o;
}

/// Duration and parameters of the training.
struct TrainOptions {
  int steps = 600;
  int init_steps = -1;
  int batch = 2;
  double learning_rate = 1e-3;
  double texture_learning_rate = 1e-2;
  double decay_share = 0.4;
  double clip_norm = 1.0;
  double weight_l1 = 1.0;
  double weight_ssim = 0.5;
  double weight_gradient = 0.0;
  double weight_perceptual = 0.5;
  std::string perceptual = "none";
  double weight_mask = 2.0;
  double weight_part = 1.0;
  double weight_uv = 4.0;
  double keep_init = -1;
  double weight_logit = 1e-3;
  double weight_gan = 0.1;
  double weight_features = 1.0;
  double weight_warp = 1.0;
  int critic_width = 16;
  int critic_layers = 3;
  int critic_scales = 2;
  double foreground_weight = 10.0;
  double jitter_scale = 0.1;
  double jitter_shift = 0.05;
  double jitter_roll_deg = 5.0;
  double ema = 0.0;
  bool freeze_unseen = true;
  int texture_images = 64;
  int save_every = 200;
  int report_every = 20;
  int validate_images = 8;
  int patience = 0;
  double least_gain = 0.01;
  int image_every = 0;
  std::string device = "auto";
  bool amp = false;
};

template <class Visitor>
void VisitStepFields(Visitor&& visit, TrainOptions& o) {
  StartGroup(visit, "Schedule");
  visit("steps", o.steps, "end-to-end steps; `avatar train` takes 0 on a fitted body without validation images");
  visit("init-steps", o.init_steps,
        "steps that teach the network the template's part and texture coordinates first; -1: a third of option 'steps', or "
        "none where the network knows them already (option 'prior' template, option 'init-from')");
  visit("batch", o.batch, "images per step");
  visit("learning-rate", o.learning_rate, "Adam step of the network's weights");
  visit("texture-learning-rate", o.texture_learning_rate, "Adam step of the texels, which lie in [-1, 1]");
  visit("decay-share", o.decay_share, "last share of all steps in which both step sizes fall linearly to 2 %");
  visit("clip-norm", o.clip_norm, "gradients of the network with a larger norm are clipped; 0: never");
}

template <class Visitor>
void VisitLossFields(Visitor&& visit, TrainOptions& o) {
  StartGroup(visit, "Losses");
  visit("weight-l1", o.weight_l1, "weight of the mean absolute colour difference");
  visit("weight-ssim", o.weight_ssim, "weight of 1 - SSIM (7 px box window)");
  visit("weight-gradient", o.weight_gradient, "weight of the mean absolute difference of image gradients at three scales");
  visit("weight-perceptual", o.weight_perceptual, "weight of the mean absolute difference of a fixed network's activations");
  visit("perceptual", o.perceptual,
        "that network: posenet (mvstudio models fetch), a TorchScript file that returns activations (VGG's first twelve "
        "layers, the paper's), none, or auto: posenet when it is installed");
  visit("weight-mask", o.weight_mask, "weight of the negative log likelihood of the silhouette");
  StartGroup(visit, "Losses of the initialisation");
  visit("weight-part", o.weight_part, "initialisation: weight of the cross-entropy of the template's parts");
  visit("weight-uv", o.weight_uv,
        "initialisation: weight of the mean absolute difference to the template's texture coordinates");
  visit("keep-init", o.keep_init,
        "share of the two initialisation terms that stays on while training end to end; -1: 0.2, or 0 with option 'prior' "
        "template, which they would only hold back");
  StartGroup(visit, "Losses");
  visit("weight-logit", o.weight_logit,
        "weight of the penalty on saturated texture coordinates (|x| > 4 before tanh) and logits (|x| > 20)");
  StartGroup(visit, "Method v2v");
  visit("weight-gan", o.weight_gan, "v2v: weight of the least-squares loss of the patch discriminators");
  visit("weight-features", o.weight_features, "v2v: weight of the difference of the discriminators' activations");
  visit("weight-warp", o.weight_warp,
        "v2v: weight of the difference between the previous frame, warped by the flow, and this one");
  visit("critic-width", o.critic_width, "v2v: channels of a discriminator's first layer (vid2vid: 64)");
  visit("critic-layers", o.critic_layers, "v2v: strided layers of a discriminator (vid2vid: 3)");
  visit("critic-scales", o.critic_scales, "v2v: discriminators, each on the image halved once more (vid2vid: 2)");
  StartGroup(visit, "Losses");
  visit("foreground-weight", o.foreground_weight, "weight of a pixel of the person relative to one of the background");
}

template <class Visitor>
void VisitFields(Visitor&& visit, TrainOptions& o) {
  VisitStepFields(visit, o);
  VisitLossFields(visit, o);
  StartGroup(visit, "Random changes of the images");
  visit("jitter-scale", o.jitter_scale, "images are scaled at random by up to this share");
  visit("jitter-shift", o.jitter_shift, "images are shifted at random by up to this share of their size");
  visit("jitter-roll-deg", o.jitter_roll_deg, "degrees; images are rotated at random about their centre by up to this angle");
  StartGroup(visit, "Schedule");
  visit(
      "ema", o.ema,
      "share of the running average of weights and textures that stays at each step, e.g. 0.999 (less in the first steps); the "
      "average is what a checkpoint is used with; 0: the last weights");
  StartGroup(visit, "Textures");
  visit("freeze-unseen", o.freeze_unseen,
        "texels that no image shows keep the colours of their neighbours; off: they follow the faint gradients that reach "
        "them");
  visit("texture-pictures", o.texture_images, "images whose colours are averaged into the first textures");
  StartGroup(visit, "Checkpoints and validation");
  visit("save-every", o.save_every, "steps between checkpoints");
  visit("report-every", o.report_every, "steps between rows of the history");
  visit("validate-pictures", o.validate_images, "held-out images scored at each checkpoint");
  visit("patience", o.patience,
        "training ends after this many checkpoints in a row without a better score on the validation images, and the weights "
        "of the best one are used; 0: train to the end and use the last");
  visit("least-gain", o.least_gain,
        "a network that adds less SSIM than this to its fitted body on validation images is left out; 0: never");
  visit("picture-every", o.image_every,
        "steps between pictures/step_NNNNNN.png: truth, rendering, error, network input; 0: none");
  StartGroup(visit, "Machine");
  visit("device", o.device, "auto (the GPU when libtorch finds one), cpu or cuda");
  visit("amp", o.amp, "half-precision convolutions with scaled gradients; on a GPU only");
}

/// Name -> text of every field, for checkpoints and provenance.
template <class Options>
std::vector<std::pair<std::string, std::string>> FieldsAsText(const Options& options);
/// Sets the field `name` from text; false when there is none. Throws UsageError when the text is invalid for the type.
template <class Options>
bool SetFieldFromText(Options& options, const std::string& name, const std::string& text);

extern template std::vector<std::pair<std::string, std::string>> FieldsAsText(const ModelOptions&);
extern template std::vector<std::pair<std::string, std::string>> FieldsAsText(const TrainOptions&);
extern template bool SetFieldFromText(ModelOptions&, const std::string&, const std::string&);
extern template bool SetFieldFromText(TrainOptions&, const std::string&, const std::string&);

/// Number of initialisation steps: the option if set; else a third of `steps`. None when the network is `transferred` from
/// another avatar or sees the template, because both already determine the parts.
int InitSteps(const TrainOptions& options, const ModelOptions& model, bool transferred);

/// Weight of the initialisation terms after the initialisation: the option if set, else a value for the network.
double KeepInit(const TrainOptions& options, const ModelOptions& model);

/// Throws UsageError naming the field that is out of range.
void Validate(const ModelOptions& options);
void Validate(const TrainOptions& options);

}  // namespace mvstudio::avatar
