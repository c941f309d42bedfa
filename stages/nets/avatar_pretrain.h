#pragma once

#include <string>
#include <string_view>
#include <type_traits>

#include "avatar/run/pretrain/pretrain_samples.h"
#include "avatar/settings/options.h"
#include "core/choice/option_group.h"
#include "core/fields.h"
#include "core/progress.h"
#include "stages/nets/pretrain_input.h"
#include "stages/result.h"

/// A generic network that knows parts and coordinates of people in general, to begin the training of avatars with.
namespace mvstudio::stages {

/// Whether an option of networks or of training has a use in pretraining.
bool IsOfPretraining(std::string_view option);

struct PretrainOptions {
  PretrainOptions() { train.steps = 0, train.init_steps = 10000, train.validate_images = 0; }
  int samples = 512;
  int scored = 256;
  avatar::PretrainSampleOptions sample;
  avatar::ModelOptions model;
  avatar::TrainOptions train;  ///< its initialisation steps are those of the pretraining
};

/// Passes on the fields that pretraining has a use for.
template <class Visitor>
struct OfPretraining {
  Visitor& visit;

  template <class Value>
  void operator()(const std::string& name, Value& value, const std::string& help) const {
    if (IsOfPretraining(name)) visit(name, value, help);
  }
  void StartGroup(const char* subject) const { mvstudio::StartGroup(visit, subject); }
};

template <class Visitor>
void VisitFields(Visitor&& visit, PretrainOptions& o) {
  const OfPretraining<std::remove_reference_t<Visitor>> some{visit};
  StartGroup(visit, "Schedule");
  visit("steps", o.train.init_steps, "steps; each is of option 'batch' new samples");
  visit("samples", o.samples, "samples that are drawn at a time; each is seen once, then others are drawn");
  visit("scored-samples", o.scored, "samples of the poses learned from, and of those held out, that are scored at the end");
  StartGroup(visit, "Random bodies and cameras");
  VisitFields(visit, o.sample);
  VisitFields(some, o.model);
  VisitFields(some, o.train);
}

/// Throws UsageError naming the option.
void Validate(const PretrainOptions& options);

/// Trains in `folder`, which then has the checkpoint of a run without end-to-end steps, and kPretrainFile: sources, options,
/// scores. The same again returns what is there, or goes on where it was interrupted. Throws UsageError when something else
/// is there and `overwrite` is off, CancelledError after saving. `relative`: files name paths as seen from the folder.
CommandResult Pretrain(const PretrainInput& input, const PretrainOptions& options, const std::string& folder, bool overwrite,
                       bool relative, const RunContext& run);

}  // namespace mvstudio::stages
