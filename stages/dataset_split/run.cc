#include "stages/dataset_split/run.h"

#include <utility>

#include "core/choice/frame_choice.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/panoptic/panoptic.h"
#include "stages/frame_notice.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

dataset::Split ReadOrMakeSplit(const dataset::PanopticDataset& data, DatasetSplitOptions* options, InputNotes* notes) {
  if (!options->describe.empty()) {
    dataset::Split split = dataset::ReadSplit(options->describe);
    dataset::RequireSplitOf(split, data, options->describe);
    notes->inputs.push_back(options->describe);
    return split;
  }
  if (options->out.empty())
    throw UsageError("option 'out' is needed: the file for the split (or option 'describe' an existing one)");
  const auto choose = [&](const char* option, const std::string& ranges) {
    const FrameChoice choice = KnownFrames(option, ParseRanges(option, ranges), data.frames, data.root);
    NoteFrames(choice.beyond, notes);
    return choice.frames;
  };
  options->split.test_frames = choose("option 'holdout-frames'", options->test_frames);
  options->split.validation_frames = choose("option 'validation-frames'", options->validation_frames);
  return dataset::MakeSplit(data, options->split);
}

}  // namespace

DatasetSplitReport RunDatasetSplit(DatasetSplitOptions options, const RunContext& run) {
  DatasetSplitReport report;
  report.notes.inputs = {options.dataset};
  options.split.seed = run.seed;
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(options.dataset);
  report.split = ReadOrMakeSplit(data, &options, &report.notes);
  report.distance = dataset::DescribeSplit(data, report.split);
  if (!options.out.empty()) {
    const OutputFiles place({options.out}, report.notes.inputs);
    dataset::WriteSplit(report.split, options.out);
  }
  report.options = std::move(options);
  return report;
}

}  // namespace mvstudio::stages
