#pragma once

#include <string>

#include "core/choice/option_style.h"
#include "dataset/import/panoptic_import.h"

/// Another project's recordings as a session: what a caller gives.
namespace mvstudio::stages {

struct DatasetImportOptions {
  std::string folder;  ///< with calibration_<sequence>.json
  std::string out;     ///< session folder
  dataset::PanopticImportOptions how;
};

/// Without the folder that is read.
template <class Visitor>
void VisitFields(Visitor&& visit, DatasetImportOptions& o) {
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "new session folder");
  VisitFields(visit, o.how);
}

}  // namespace mvstudio::stages
