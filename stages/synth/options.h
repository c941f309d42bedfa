#pragma once

#include <string>

#include "core/choice/option_style.h"
#include "synth/session.h"

/// A synthetic session with ground truth: what a caller gives.
namespace mvstudio::stages {

struct SynthSessionOptions {
  std::string out;  ///< folder
  bool overwrite = false;
  synth::SynthOptions studio;
};

template <class Visitor>
void VisitFields(Visitor&& visit, SynthSessionOptions& o) {
  VisitStyled(visit, OptionStyle::kFolder, "out", o.out, "session folder to write");
  VisitStyled(visit, OptionStyle::kSwitch, "overwrite", o.overwrite, "replace an existing session");
  VisitFields(visit, o.studio);
}

}  // namespace mvstudio::stages
