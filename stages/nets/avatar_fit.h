#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "avatar/run/pack/person_fit.h"
#include "avatar/run/pack/run_config.h"
#include "core/progress.h"
#include "stages/result.h"

/// The person's own body, fitted before a network is trained.
namespace mvstudio::stages {

enum class BodyFitMode {
  kAuto,    ///< skeleton, surface and colours by joints, silhouettes and brightness
  kGirths,  ///< the mannequin with four girths
  kOff,     ///< the mannequin as it is
};
std::string_view ToString(BodyFitMode mode);
void FromString(const std::string& text, BodyFitMode* mode);

/// "mannequin", a path, several with commas between them, or "auto": the mannequin and all bodies in the models' folder, in
/// `bodies`. As options of the fit take them. Throws UsageError for a path that does not exist.
std::vector<std::string> TemplatesOf(const std::string& text);

/// Fits to the training images of a split. Those of held-out cameras are not looked at. Those of training cameras in held-out
/// frames pose the body there, with PoseBy::kImages and held-out cameras to be scored on; they tell nothing else of it.
avatar::PersonFit FitToSplit(const dataset::PanopticDataset& data, const avatar::DatasetSplit& split, int person,
                             avatar::PoseBy pose_by, avatar::PersonFitOptions options, const RunContext& run);

/// A body that `avatar fit` or `avatar train` wrote: its file, or the folder with it. Throws UsageError when it was fitted to
/// images that the split does not train on, or does not say to which.
body::TexturedPerson BodyForSplit(const std::string& path, const avatar::DatasetSplit& split, avatar::PoseBy pose_by);

/// IoU before and after, stages, cameras, rejected silhouettes; and what the user should know: warnings, or why it is no fit.
nlohmann::ordered_json ToJson(const avatar::PersonFit& fit);
CommandResult JudgeFit(const avatar::PersonFit& fit);
std::string ToTable(const avatar::PersonFit& fit);

}  // namespace mvstudio::stages
