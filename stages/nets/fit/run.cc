#include "stages/nets/fit/run.h"

#include "core/disk/output.h"
#include "stages/nets/avatar_fit.h"

namespace mvstudio::stages {

AvatarFitReport RunAvatarFit(const AvatarFitOptions& options, const RunContext& run) {
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(options.dataset);
  const int person = avatar::ChoosePerson(data, options.person.person);
  const avatar::DatasetSplit split = SplitOf(data, person, options.split);
  avatar::PersonFitOptions fit = options.person;
  fit.templates = TemplatesOf(options.body_template);
  const OutputFolder place(options.out, {options.dataset}, BodyFolder::Names());
  AvatarFitReport report;
  report.dataset = options.dataset, report.folder = options.out;
  report.conflicts = CheckTrainingImages(data, split, run);
  const BodyFolder folder(options.out, options.overwrite);
  report.fit = FitToSplit(data, split, person, options.pose_by, fit, run);
  ReportSplitFrames(data, options.split, &report.notes);
  report.surface = folder.Write(report.fit.result, options.frame_rate_hz);
  report.masks = data.Masks();
  return report;
}

}  // namespace mvstudio::stages
