#pragma once

#include <string>

#include "common/domain/bake_domain.h"
#include "coordinator/bake.h"

namespace glint {

/// What does not depend on where and how often the bake ran: goes into the archive, byte-identical.
std::string DeterministicReportJson(const BakeReport& report, const BakeDomain& domain,
                                    const BakeOptions& options);
/// That, and the archive's key, seconds by stage, tasks reused, archive bytes.
std::string FullReportJson(const BakeReport& report);

}  // namespace glint
