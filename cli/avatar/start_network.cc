#include "cli/avatar/start_network.h"

#include "app/nets/avatar_run.h"
#include "core/error.h"

namespace mvstudio::cli {
namespace {

/// Options that a new network may have otherwise than the one that it starts from.
bool MayDiffer(const std::string& option, bool other_method) {
  return option == "texture-px" || option == "method" || (option == "template-colours" && other_method);
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
}

/// Without a fitted body there are no colours that a network could correct.
void SettleColours(const StartArguments& arguments, bool transferred, avatar::ModelOptions* model) {
  if (!CorrectsColours(*model) || arguments.fit == app::BodyFitMode::kAuto) return;
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
  if (model.method != from.method) model.template_colours = arguments.model.template_colours;
  return model;
}

}  // namespace

std::optional<avatar::AvatarModel> StartOf(const StartArguments& arguments) {
  if (arguments.init_from.empty()) return std::nullopt;
  avatar::AvatarModel from = avatar::LoadModel(app::AvatarRun(arguments.init_from).checkpoint_path());
  RequireFit(arguments, from.options);
  return from;
}

avatar::ModelOptions ModelOf(const StartArguments& arguments, const std::optional<avatar::AvatarModel>& from, bool labelled) {
  avatar::ModelOptions model = from ? Transferred(arguments, from->options) : arguments.model;
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
