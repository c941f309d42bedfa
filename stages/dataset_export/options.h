#pragma once

#include <string>

#include "core/choice/option_style.h"
#include "core/fields.h"
#include "core/join.h"
#include "dataset/exports/export.h"

/// A dataset in the layout of another program: what a caller gives.
namespace mvstudio::stages {

struct DatasetExportOptions {
  std::string dataset;  ///< folder in Panoptic layout
  std::string to;       ///< name of the format
  std::string out;      ///< new folder; or the one file of a format that writes such, where it ends as that does
  std::string frames;   ///< "80-99" or "1,4,7-9", or "all"; empty: as `layout` says
  exports::ExportOptions layout;
};

/// Without the dataset.
template <class Visitor>
void VisitFields(Visitor&& visit, DatasetExportOptions& o) {
  visit("to", o.to, "format: " + Join(exports::Formats(), ", ", &exports::FormatInfo::name));
  VisitStyled(visit, OptionStyle::kPlace, "out", o.out,
              "new folder; of csv, npz, gltf and mcap also the file alone, where the name ends in .csv, .npz, .glb or .mcap");
  visit("cameras", o.layout.cameras, "only these, of either name, separated by commas; default: all");
  visit("frames", o.frames,
        "80-99 or 1,4,7-9, or all; default: the first for formats of one time step (colmap, nerfstudio), else all");
  visit("split", o.layout.split, "split file: its cameras and frames, train and test where the format has them");
  VisitFields(visit, o.layout);
}

}  // namespace mvstudio::stages
