#pragma once

#include <string>
#include <vector>

#include "avatar/body/body_template.h"
#include "stages/body_template/options.h"

namespace mvstudio::stages {

struct BodyTemplateReport {
  BodyTemplateOptions options;
  std::vector<std::string> inputs;
  body::BodyTemplate body;
};

/// Reads the template; a .pkl file is not run. Throws IoError where there is none, UsageError for an output that exists or that
/// the source's layout does not allow, FormatError.
BodyTemplateReport RunBodyTemplate(const BodyTemplateOptions& options);

}  // namespace mvstudio::stages
