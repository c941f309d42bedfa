#pragma once

#include <string>

#include "core/choice/option_style.h"
#include "dataset/verify/session_check.h"

/// Checks of the machine and of a session: what a caller gives.
namespace mvstudio::stages {

struct DoctorOptions {
  std::string path;  ///< a session, or a folder of footage; empty: the machine alone
  dataset::InspectOptions inspect;
};

template <class Visitor>
void VisitFields(Visitor&& visit, DoctorOptions& o) {
  VisitStyled(visit, OptionStyle::kSwitch, "decode", o.inspect.decode,
              "decode every frame, instead of reading time stamps only");
  VisitStyled(visit, OptionStyle::kSwitch, "allow-outside", o.inspect.allow_outside,
              "allow the session to name files outside its folder");
}

}  // namespace mvstudio::stages
