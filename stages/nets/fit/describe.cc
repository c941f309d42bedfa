#include "stages/nets/fit/describe.h"

#include "core/notice.h"
#include "stages/input/mask_notice.h"
#include "stages/nets/avatar_fit.h"

namespace mvstudio::stages {

CommandResult Describe(const AvatarFitReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.folder = report.folder, result.inputs = {report.dataset};
  result.metrics = ToJson(report.fit);
  result.Add(DescribeBodyFolder(report.folder, report.surface));
  result.text = ToTable(report.fit);
  result.Add(JudgeFit(report.fit));
  Append(report.conflicts, &result.warnings);
  result.Add(DescribeMaskMeaning(report.masks, report.dataset + "/masks", result.text));
  return result;
}

}  // namespace mvstudio::stages
