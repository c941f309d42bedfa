#include "python/errors.h"

#include <exception>
#include <filesystem>
#include <new>
#include <string>

#include "core/choice/frame_choice.h"
#include "core/disk/lock.h"
#include "core/error.h"

namespace mvstudio::python {
namespace py = pybind11;
namespace {

/// The code that the command line has for an exception (cli/program/result.cc); empty: none of ours.
std::string CodeOf(const std::exception& error) {
  if (dynamic_cast<const CancelledError*>(&error)) return "CLI-INTERRUPTED";
  if (dynamic_cast<const UsageError*>(&error) || dynamic_cast<const ContractViolation*>(&error)) return "CLI-USAGE";
  if (dynamic_cast<const NothingLeftError*>(&error)) return "CLI-FRAMES";
  if (dynamic_cast<const LockedError*>(&error)) return "CLI-LOCKED";
  if (dynamic_cast<const IoError*>(&error)) return "INPUT-IO";
  if (dynamic_cast<const FormatError*>(&error)) return "INPUT-FORMAT";
  if (dynamic_cast<const ResourceError*>(&error)) return "RESOURCES";
  if (dynamic_cast<const MissingToolError*>(&error)) return "MISSING-TOOL";
  if (dynamic_cast<const std::filesystem::filesystem_error*>(&error)) return "INPUT-IO";
  return dynamic_cast<const Error*>(&error) ? "INTERNAL" : "";
}

void Translate(std::exception_ptr thrown) {
  try {
    if (thrown) std::rethrow_exception(thrown);
  } catch (const std::bad_alloc&) {
    PyErr_NoMemory();
  } catch (const py::builtin_exception&) {
    throw;
  } catch (const py::error_already_set&) {
    throw;
  } catch (const std::exception& error) {
    const std::string code = CodeOf(error);
    if (code.empty()) throw;
    const py::object type = py::module_::import("mvstudio._error").attr("Error");
    PyErr_SetObject(type.ptr(), type.attr("of")(code, error.what()).ptr());
  }
}

}  // namespace

void TranslateErrors() { py::register_exception_translator(Translate); }

}  // namespace mvstudio::python
