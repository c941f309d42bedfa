#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "avatar/settings/options.h"
#include "core/fields.h"
#include "core/progress.h"
#include "stages/result.h"

/// One renderer of method `hf` for several people, to begin the training of another with.
namespace mvstudio::stages {

struct RendererPretraining {
  std::vector<std::string> runs;  ///< folders of `avatar train --method hf`, one a person, with or without steps
  avatar::TrainOptions train;     ///< `steps` of all people together
};

/// Whether an option of training has a use here.
bool IsOfRenderers(std::string_view option);

template <class Visitor>
void VisitFields(Visitor&& visit, RendererPretraining& o) {
  visit("steps", o.train.steps, "steps of all people together; each is of option 'batch' images of one of them");
  const auto some = [&visit](const std::string& name, auto& value, const std::string& help) {
    if (IsOfRenderers(name)) visit(name, value, help);
  };
  VisitFields(some, o.train);
}

/// Trains a new renderer on the training images of all runs, in turns, with a neural texture for each. `folder` then has its
/// checkpoint without textures, and kPretrainFile with the datasets and frames that it saw. Throws UsageError where the runs'
/// networks differ, one is of another method, or `folder` holds something.
CommandResult PretrainRenderer(const RendererPretraining& arguments, const std::string& folder, bool overwrite,
                               const RunContext& run);

}  // namespace mvstudio::stages
