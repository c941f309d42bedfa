#include "stages/nets/train/start.h"

#include "core/error.h"
#include "stages/nets/avatar_run.h"

namespace mvstudio::stages {
namespace {

/// What does not shape the renderer of `hf`; the number of references does when it is 0.
bool IsReferenceChoice(const std::string& option) {
  return option == "references" || option == "reference-choice" || option == "reference-gap";
}

/// Options that a new network may have otherwise than the one that it starts from.
bool MayDiffer(const std::string& option, bool other_method) {
  return IsReferenceChoice(option) || option == "texture-px" || option == "method" ||
         (option == "template-colours" && other_method);
}

/// What was asked for and the network that training starts from has not is a usage error.
void RequireFit(const AvatarTrainOptions& options, const avatar::ModelOptions& from) {
  const bool other_method = options.Given("method") && options.model.method != from.method;
  const auto wanted = FieldsAsText(options.model), has = FieldsAsText(from);
  for (size_t i = 0; i < wanted.size(); ++i) {
    const auto& [name, value] = wanted[i];
    if (MayDiffer(name, other_method) || !options.Given(name) || value == has[i].second || value == "auto") continue;
    throw UsageError("option '" + name + "' " + value + ": the network of option 'init-from' " + options.init_from + " has " +
                     has[i].second + "; leave the option out");
  }
  const bool hf = options.model.method == avatar::Method::kHf, from_hf = from.method == avatar::Method::kHf;
  if (other_method && (hf || from_hf))
    throw UsageError("option 'method' " + std::string(ToString(options.model.method)) + ": the network of option 'init-from' " +
                     options.init_from + " is of method " + std::string(ToString(from.method)) +
                     ", and option 'method' hf shares no layer with others");
  if (from_hf && options.Given("references") && (options.model.references > 0) != (from.references > 0))
    throw UsageError("option 'references' " + std::to_string(options.model.references) +
                     ": the network of option 'init-from' " + options.init_from +
                     (from.references > 0 ? " takes references" : " takes none") + "; leave the option out");
}

/// Without a fitted body there are no colours that a network could correct.
void SettleColours(const AvatarTrainOptions& options, bool transferred, avatar::ModelOptions* model) {
  if (!CorrectsColours(*model) || options.fit == BodyFitMode::kAuto) return;
  const std::string fit(ToString(options.fit));
  if (transferred)
    throw UsageError("option 'fit' " + fit + ": the network of option 'init-from' " + options.init_from +
                     " corrects the fitted body's colours; take option 'fit' auto");
  if (options.Given("template-colours"))
    throw UsageError("option 'template-colours' needs the colours of a fitted body, which option 'fit' " + fit +
                     " has not; take option 'fit' auto");
  model->template_colours = false;
}

/// The options of `from` with what may differ.
avatar::ModelOptions Transferred(const AvatarTrainOptions& options, const avatar::ModelOptions& from) {
  avatar::ModelOptions model = from;
  model.texture_px = options.model.texture_px;
  if (options.Given("method")) model.method = options.model.method;
  if (options.Given("references")) model.references = options.model.references;
  if (options.Given("reference-choice")) model.reference_choice = options.model.reference_choice;
  if (options.Given("reference-gap")) model.reference_gap = options.model.reference_gap;
  if (model.method != from.method) model.template_colours = options.model.template_colours;
  return model;
}

/// Options that the method has no use for are usage errors.
void RefuseOthers(const AvatarTrainOptions& options, avatar::Method method) {
  const bool hf = method == avatar::Method::kHf;
  for (const char* option : {"neural-channels", "references", "reference-choice", "reference-gap"})
    if (!hf && options.Given(option)) throw UsageError("option '" + std::string(option) + "' needs option 'method' hf");
  for (const char* option : {"inputs", "encoder-blocks", "decoder-blocks", "stem-kernel", "upsample", "spread-parts",
                             "relative-depth", "bone-half-width-px", "pose3d", "init-steps", "weight-part", "weight-uv",
                             "keep-init", "freeze-unseen", "texture-pictures"})
    if (hf && options.Given(option))
      throw UsageError("option '" + std::string(option) +
                       "' is of other networks: option 'method' hf has no use for it; leave it out");
  if (hf && options.fit != BodyFitMode::kAuto)
    throw UsageError("option 'method' hf needs a body that is fitted: option 'fit' auto, or option 'body'");
}

}  // namespace

std::optional<avatar::AvatarModel> StartOf(const AvatarTrainOptions& options) {
  if (options.init_from.empty()) return std::nullopt;
  const std::string checkpoint = AvatarRun(options.init_from).checkpoint_path();
  avatar::RequireCheckpoint(checkpoint);
  avatar::AvatarModel from = avatar::LoadModel(checkpoint);
  RequireFit(options, from.options);
  return from;
}

avatar::ModelOptions ModelOf(const AvatarTrainOptions& options, const std::optional<avatar::AvatarModel>& from) {
  const bool labelled = !options.pack.iuv.empty();  // the first guess is DensePose's
  avatar::ModelOptions model = from ? Transferred(options, from->options) : options.model;
  RefuseOthers(options, model.method);
  if (model.prior == avatar::Prior::kAuto) model.prior = labelled ? avatar::Prior::kNone : avatar::Prior::kTemplate;
  if (model.prior == avatar::Prior::kTemplate && labelled)
    throw UsageError(
        "option 'iuv' and option 'prior' template: DensePose's coordinates are not the template's; take option 'prior' none");
  SettleColours(options, from && from->options.method == model.method, &model);
  Validate(model);
  return model;
}

}  // namespace mvstudio::stages
