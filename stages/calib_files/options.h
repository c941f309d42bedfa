#pragma once

#include <string>
#include <vector>

#include "core/choice/option_style.h"
#include "core/join.h"
#include "stages/calib/lens_library.h"
#include "stages/input/calib_read.h"

/// Calibrations that are shown, written for another program or for images of another size, and libraries of their lenses: what
/// a caller gives. The lists are without the files that are read and how that is done.
namespace mvstudio::stages {

struct CalibShowOptions {
  std::vector<std::string> in;  ///< files or a folder
  CalibReadOptions read;
};

struct CalibConvertOptions {
  std::vector<std::string> in;
  std::string to = "mvstudio";  ///< of CalibOutputNames()
  std::string out;              ///< file or folder
  calib::LengthUnit out_unit = calib::LengthUnit::kMetre;
  std::vector<std::string> rename;  ///< OLD=NEW
  CalibReadOptions read;
};

/// Formats of calibrations, then those of whole datasets that hold the cameras by themselves too.
std::vector<std::string> CalibOutputNames();

template <class Visitor>
void VisitFields(Visitor&& visit, CalibConvertOptions& o) {
  visit("to", o.to, "format of the output: " + Join(CalibOutputNames(), ", "));
  VisitStyled(visit, OptionStyle::kPlace, "out", o.out,
              "file to write; a folder for colmap and easymocap, and for opencv and mrcal with several cameras; the formats of "
              "datasets write the file alone where the name ends as it does (.npz, .glb, .ply, …)");
  visit("out-unit", o.out_unit, "unit of length to write in formats that name none: m, cm, mm or in");
  visit("rename", o.rename, "OLD=NEW, give a camera another name; may be repeated");
}

struct CalibResizeOptions {
  std::string calibration;
  std::string size;                      ///< WIDTHxHEIGHT; empty: that of the crop
  std::vector<std::string> camera_size;  ///< NAME=WIDTHxHEIGHT
  std::vector<std::string> crop;         ///< X,Y,WIDTH,HEIGHT or NAME=X,Y,WIDTH,HEIGHT
  std::string out;                       ///< file
};

template <class Visitor>
void VisitFields(Visitor&& visit, CalibResizeOptions& o) {
  visit("size", o.size, "WIDTHxHEIGHT px of the new images, for every camera; that of option 'crop' unless given");
  visit("camera-size", o.camera_size, "NAME=WIDTHxHEIGHT, for one camera; may be repeated");
  visit("crop", o.crop,
        "X,Y,WIDTH,HEIGHT, or NAME=X,Y,WIDTH,HEIGHT: the part of the calibrated image that the new images show, in its px; it "
        "may reach beyond it; the whole image unless given");
  VisitStyled(visit, OptionStyle::kFile, "out", o.out, "file to write");
}

struct LensAddOptions {
  std::string library, calibration, camera;
  LensKey key;
  bool replace = false;
};

template <class Visitor>
void VisitFields(Visitor&& visit, LensAddOptions& o) {
  visit("camera", o.camera, "its name in the calibration");
  visit("serial", o.key.serial, "serial number, as mvstudio.toml has it");
  visit("setting", o.key.setting, "how the lens is set: focal length, focus, resolution");
  VisitStyled(visit, OptionStyle::kSwitch, "replace", o.replace, "replace the lens of that serial number and setting");
}

}  // namespace mvstudio::stages
