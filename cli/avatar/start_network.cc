#include "cli/avatar/start_network.h"

#include "core/error.h"
#include "stages/nets/avatar_run.h"

namespace mvstudio::cli {
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
void RequireFit(const StartArguments& arguments, const avatar::ModelOptions& from) {
  const bool other_method = arguments.given("method") && arguments.model.method != from.method;
  const auto wanted = FieldsAsText(arguments.model), has = FieldsAsText(from);
  for (size_t i = 0; i < wanted.size(); ++i) {
    const auto& [name, value] = wanted[i];
    if (MayDiffer(name, other_method) || !arguments.given(name) || value == has[i].second || value == "auto") continue;
    throw UsageError("--" + name + " " + value + ": the network of --init-from " + arguments.init_from + " has " +
                     has[i].second + "; leave the option out");
  }
  const bool hf = arguments.model.method == avatar::Method::kHf, from_hf = from.method == avatar::Method::kHf;
  if (other_method && (hf || from_hf))
    throw UsageError("--method " + std::string(ToString(arguments.model.method)) + ": the network of --init-from " +
                     arguments.init_from + " is of method " + std::string(ToString(from.method)) +
                     ", and --method hf shares no layer with others");
  if (from_hf && arguments.given("references") && (arguments.model.references > 0) != (from.references > 0))
    throw UsageError("--references " + std::to_string(arguments.model.references) + ": the network of --init-from " +
                     arguments.init_from + (from.references > 0 ? " takes references" : " takes none") +
                     "; leave the option out");
}

/// Without a fitted body there are no colours that a network could correct.
void SettleColours(const StartArguments& arguments, bool transferred, avatar::ModelOptions* model) {
  if (!CorrectsColours(*model) || arguments.fit == stages::BodyFitMode::kAuto) return;
  const std::string fit(ToString(arguments.fit));
  if (transferred)
    throw UsageError("--fit " + fit + ": the network of --init-from " + arguments.init_from +
                     " corrects the fitted body's colours; take --fit auto");
  if (arguments.given("template-colours"))
    throw UsageError("--template-colours needs the colours of a fitted body, which --fit " + fit + " has not; take --fit auto");
  model->template_colours = false;
}

/// The options of `from` with what may differ.
avatar::ModelOptions Transferred(const StartArguments& arguments, const avatar::ModelOptions& from) {
  avatar::ModelOptions model = from;
  model.texture_px = arguments.model.texture_px;
  if (arguments.given("method")) model.method = arguments.model.method;
  if (arguments.given("references")) model.references = arguments.model.references;
  if (arguments.given("reference-choice")) model.reference_choice = arguments.model.reference_choice;
  if (arguments.given("reference-gap")) model.reference_gap = arguments.model.reference_gap;
  if (model.method != from.method) model.template_colours = arguments.model.template_colours;
  return model;
}

/// Options that the method has no use for are usage errors.
void RefuseOthers(const StartArguments& arguments, avatar::Method method) {
  const bool hf = method == avatar::Method::kHf;
  for (const char* option : {"neural-channels", "references", "reference-choice", "reference-gap"})
    if (!hf && arguments.given(option)) throw UsageError("--" + std::string(option) + " needs --method hf");
  for (const char* option : {"inputs", "encoder-blocks", "decoder-blocks", "stem-kernel", "upsample", "spread-parts",
                             "relative-depth", "bone-half-width-px", "pose3d", "init-steps", "weight-part", "weight-uv",
                             "keep-init", "freeze-unseen", "texture-pictures"})
    if (hf && arguments.given(option))
      throw UsageError("--" + std::string(option) + " is of other networks: --method hf has no use for it; leave it out");
  if (hf && arguments.fit != stages::BodyFitMode::kAuto)
    throw UsageError("--method hf needs a body that is fitted: --fit auto, or --body");
}

}  // namespace

std::optional<avatar::AvatarModel> StartOf(const StartArguments& arguments) {
  if (arguments.init_from.empty()) return std::nullopt;
  avatar::AvatarModel from = avatar::LoadModel(stages::AvatarRun(arguments.init_from).checkpoint_path());
  RequireFit(arguments, from.options);
  return from;
}

avatar::ModelOptions ModelOf(const StartArguments& arguments, const std::optional<avatar::AvatarModel>& from, bool labelled) {
  avatar::ModelOptions model = from ? Transferred(arguments, from->options) : arguments.model;
  RefuseOthers(arguments, model.method);
  if (model.prior == avatar::Prior::kAuto) model.prior = labelled ? avatar::Prior::kNone : avatar::Prior::kTemplate;
  if (model.prior == avatar::Prior::kTemplate && labelled)
    throw UsageError("--iuv and --prior template: DensePose's coordinates are not the template's; take --prior none");
  SettleColours(arguments, from && from->options.method == model.method, &model);
  Validate(model);
  return model;
}

void TellStart(const StartArguments& arguments, const avatar::AvatarModel& from, const avatar::StartNetwork& start,
               CommandResult* result) {
  result->metrics["init_from"] = {{"run", arguments.init_from},
                                  {"method", ToString(from.options.method)},
                                  {"taken", start.taken},
                                  {"partly", start.partly},
                                  {"fresh", start.fresh}};
  result->text += "begun with " + std::to_string(start.taken.size()) + " layers of " + arguments.init_from + ", " +
                  std::to_string(start.partly.size()) + " taken in part and " + std::to_string(start.fresh.size()) +
                  " begun anew\n";
}

}  // namespace mvstudio::cli
