#include "avatar/settings/options.h"

#include <cmath>
#include <sstream>
#include <type_traits>

#include "avatar/settings/gaussian_options.h"
#include "core/error.h"

namespace mvstudio::avatar {
namespace {

constexpr ChoiceWords<Method, 5> kMethods = {{{Method::kTna, "tna"},
                                              {Method::kDirect, "direct"},
                                              {Method::kV2v, "v2v"},
                                              {Method::kGaussians, "gaussians"},
                                              {Method::kHf, "hf"}}};
constexpr ChoiceWords<ReferenceChoice, 2> kReferenceChoices = {
    {{ReferenceChoice::kBest, "best"}, {ReferenceChoice::kFrontBack, "frontback"}}};
constexpr ChoiceWords<NormLayer, 2> kNormLayers = {{{NormLayer::kBatch, "batch"}, {NormLayer::kInstance, "instance"}}};
constexpr ChoiceWords<Upsampling, 2> kUpsamplings = {
    {{Upsampling::kTransposed, "transposed"}, {Upsampling::kNearest, "nearest"}}};
constexpr ChoiceWords<Prior, 3> kPriors = {{{Prior::kNone, "none"}, {Prior::kTemplate, "template"}, {Prior::kAuto, "auto"}}};

void Require(bool ok, const std::string& field, const std::string& rule) {
  if (!ok) throw UsageError("option '" + field + "' must be " + rule);
}

template <class T>
std::string ToText(const T& value) {
  if constexpr (std::is_same_v<T, std::string>) {
    return value;
  } else if constexpr (kHasWords<T>) {
    return std::string(ToString(value));
  } else {
    std::ostringstream text;
    text.precision(17);
    text << value;
    return text.str();
  }
}

template <class T>
bool FromText(const std::string& text, T* value) {
  if constexpr (std::is_same_v<T, std::string>) {
    *value = text;
    return true;
  } else if constexpr (kHasWords<T>) {
    FromString(text, value);
    return true;
  } else {
    std::istringstream in(text);
    in >> *value;
    return !in.fail() && in.eof();
  }
}

}  // namespace

std::string_view ToString(Method method) { return WordOf(kMethods, method); }
std::string_view ToString(ReferenceChoice choice) { return WordOf(kReferenceChoices, choice); }
std::string_view ToString(NormLayer norm) { return WordOf(kNormLayers, norm); }
std::string_view ToString(Upsampling upsampling) { return WordOf(kUpsamplings, upsampling); }
std::string_view ToString(Prior prior) { return WordOf(kPriors, prior); }

void FromString(const std::string& text, Method* method) {
  *method = KnownChoice(kMethods, text, "option 'method' must be tna, direct, v2v, gaussians or hf");
}

void FromString(const std::string& text, ReferenceChoice* choice) {
  *choice = KnownChoice(kReferenceChoices, text, "option 'reference-choice' must be best or frontback");
}

void FromString(const std::string& text, NormLayer* norm) {
  *norm = KnownChoice(kNormLayers, text, "option 'norm' must be batch or instance");
}

void FromString(const std::string& text, Upsampling* upsampling) {
  *upsampling = KnownChoice(kUpsamplings, text, "option 'upsample' must be transposed or nearest");
}

void FromString(const std::string& text, Prior* prior) {
  *prior = KnownChoice(kPriors, text, "option 'prior' must be none or template");
}

template <class Options>
std::vector<std::pair<std::string, std::string>> FieldsAsText(const Options& options) {
  std::vector<std::pair<std::string, std::string>> fields;
  VisitConstFields(
      [&](const std::string& name, const auto& value, const std::string&) { fields.emplace_back(name, ToText(value)); },
      options);
  return fields;
}

template <class Options>
bool SetFieldFromText(Options& options, const std::string& name, const std::string& text) {
  bool found = false;
  VisitFields(
      [&](const std::string& field, auto& value, const std::string&) {
        if (field != name) return;
        found = true;
        if (!FromText(text, &value)) throw UsageError("option `" + name + "` cannot be '" + text + "'");
      },
      options);
  return found;
}

template std::vector<std::pair<std::string, std::string>> FieldsAsText(const ModelOptions&);
template std::vector<std::pair<std::string, std::string>> FieldsAsText(const TrainOptions&);
template std::vector<std::pair<std::string, std::string>> FieldsAsText(const GaussianOptions&);
template bool SetFieldFromText(ModelOptions&, const std::string&, const std::string&);
template bool SetFieldFromText(TrainOptions&, const std::string&, const std::string&);

bool CorrectsColours(const ModelOptions& options) {
  return options.prior == Prior::kTemplate && options.method != Method::kTna && options.template_colours;
}

bool TakesReferences(const ModelOptions& options) { return options.method == Method::kHf && options.references > 0; }

bool CorrectsParts(const ModelOptions& options) {
  return options.prior == Prior::kTemplate && options.method == Method::kTna && options.spread_parts;
}

ModelOptions OptionsOfOlderRuns() {
  ModelOptions options;
  options.template_colours = false, options.spread_parts = false;
  return options;
}

int InitSteps(const TrainOptions& options, const ModelOptions& model, bool transferred) {
  if (options.init_steps >= 0) return options.init_steps;
  return transferred || model.prior == Prior::kTemplate ? 0 : options.steps / 3;
}

double KeepInit(const TrainOptions& options, const ModelOptions& model) {
  if (options.keep_init >= 0) return options.keep_init;
  return model.prior == Prior::kTemplate ? 0 : 0.2;
}

void Validate(const ModelOptions& o) {
  Require(o.method != Method::kGaussians, "method", "tna, direct, v2v or hf here: Gaussians have no network");
  Require(o.width >= 1 && o.width <= 256, "width", "in 1..256");
  Require(o.downs >= 1 && o.downs <= 6, "downs", "in 1..6");
  Require(o.encoder_blocks >= 0 && o.encoder_blocks <= 32, "encoder-blocks", "in 0..32");
  Require(o.decoder_blocks >= 0 && o.decoder_blocks <= 32, "decoder-blocks", "in 0..32");
  Require(o.stem_kernel >= 1 && o.stem_kernel <= 15 && o.stem_kernel % 2 == 1, "stem-kernel", "odd and in 1..15");
  Require(o.head_kernel >= 1 && o.head_kernel <= 15 && o.head_kernel % 2 == 1, "head-kernel", "odd and in 1..15");
  Require(o.inputs >= 1 && o.inputs <= 256, "inputs", "in 1..256");
  Require(o.prior != Prior::kAuto, "prior", "none or template");
  Require(o.texture_px == 0 || (o.texture_px >= 2 && o.texture_px <= 4096), "texture-px", "0 or in 2..4096");
  Require(o.bone_half_width_px > 0 && o.bone_half_width_px < 100, "bone-half-width-px", "above 0 and below 100");
  Require(o.neural_channels >= 4 && o.neural_channels <= 256, "neural-channels", "in 4..256");
  Require(o.references >= 0 && o.references <= 32, "references", "in 0..32");
  Require(o.reference_gap >= 0 && o.reference_gap <= 1000000, "reference-gap", "in 0..1e6");
  Require(o.method != Method::kHf || CorrectsColours(o), "prior",
          "template with option 'template-colours' for option 'method' hf, which renders a fitted body");
}

void Validate(const TrainOptions& o) {
  Require(o.steps >= 0 && o.steps <= 100000000, "steps", "in 0..1e8");
  Require(o.init_steps >= -1 && o.init_steps <= 100000000, "init-steps", "in -1..1e8");
  Require(o.batch >= 1 && o.batch <= 4096, "batch", "in 1..4096");
  Require(o.learning_rate >= 0 && o.learning_rate < 1, "learning-rate", "in [0, 1)");
  Require(o.texture_learning_rate >= 0 && o.texture_learning_rate < 1, "texture-learning-rate", "in [0, 1)");
  Require(o.decay_share >= 0 && o.decay_share <= 1, "decay-share", "in [0, 1]");
  Require(o.clip_norm >= 0, "clip-norm", "at least 0");
  for (const double weight :
       {o.weight_l1, o.weight_ssim, o.weight_gradient, o.weight_mask, o.weight_part, o.weight_uv, o.weight_logit,
        o.foreground_weight, o.weight_perceptual, o.weight_gan, o.weight_features, o.weight_warp}) {
    Require(std::isfinite(weight) && weight >= 0, "weight-* (foreground-weight)", "finite and at least 0");
  }
  Require(o.keep_init == -1 || (o.keep_init >= 0 && o.keep_init < 1e6), "keep-init", "-1, or at least 0 and finite");
  Require(o.jitter_scale >= 0 && o.jitter_scale < 0.9, "jitter-scale", "in [0, 0.9)");
  Require(o.jitter_shift >= 0 && o.jitter_shift < 0.5, "jitter-shift", "in [0, 0.5)");
  Require(o.jitter_roll_deg >= 0 && o.jitter_roll_deg <= 180, "jitter-roll-deg", "in [0, 180]");
  Require(o.critic_width >= 1 && o.critic_width <= 256, "critic-width", "in 1..256");
  Require(o.critic_layers >= 1 && o.critic_layers <= 5, "critic-layers", "in 1..5");
  Require(o.critic_scales >= 1 && o.critic_scales <= 4, "critic-scales", "in 1..4");
  Require(o.texture_images >= 1, "texture-pictures", "at least 1");
  Require(o.save_every >= 1 && o.report_every >= 1 && o.validate_images >= 0, "save-every (report-every, validate-pictures)",
          "at least 1");
  Require(o.ema >= 0 && o.ema < 1, "ema", "in [0, 1)");
  Require(o.patience >= 0, "patience", "at least 0");
  Require(o.least_gain >= 0 && o.least_gain <= 1, "least-gain", "in [0, 1]");
  Require(o.image_every >= 0, "picture-every", "at least 0");
  Require(o.device == "auto" || o.device == "cpu" || o.device.rfind("cuda", 0) == 0, "device", "auto, cpu or cuda");
}

}  // namespace mvstudio::avatar
