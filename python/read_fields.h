// Private: for the Python module alone.
#pragma once

#include "core/choice/option_group.h"
#include "core/choice/option_style.h"
#include "stages/input/calib_read.h"
#include "stages/input/pose_input.h"

/// What cli/program/input_flags.cc declares, as fields; tests/python compares both with docs/cli.md.
namespace mvstudio::python {

template <class Visitor>
void VisitMeaning(Visitor& visit, stages::CalibReadOptions& o) {
  visit("lens", o.lens, "auto, perspective or fisheye: of files that do not say it (opencv, easymocap, nerfstudio, toml)");
  visit("invert", o.invert, stages::kInvertHelp);
  visit("mirror", o.mirror, stages::kMirrorHelp);
  visit("allow-approximation", o.allow_approximation_px,
        "px; the nearest lens takes the place of one that cannot be kept. Refused where a pixel of the image moves farther");
}

template <class Visitor>
void VisitFormat(Visitor& visit, stages::CalibReadOptions& o) {
  StartGroup(visit, "Reading the calibration");
  visit("from", o.from, "format of the calibration: auto, " + calib::CalibrationFormatNames());
}

template <class Visitor>
void VisitRead(Visitor& visit, stages::CalibReadOptions& o) {
  VisitFormat(visit, o);
  visit("size", o.size, "WIDTHxHEIGHT px: image size where the file does not give it");
  visit("unit", o.unit, "unit of length of files that name none: m, cm, mm or in");
  visit("frame-rate", o.frame_rate_hz, "Hz, of the cameras: kalibr's time shifts become time offsets in frames");
  visit("qca-distortion-divisor", o.qca_distortion_divisor, "qca: the distortion is divided by this when read");
  VisitMeaning(visit, o);
}

}  // namespace mvstudio::python
