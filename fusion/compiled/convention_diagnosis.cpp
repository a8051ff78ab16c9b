// Diagnosis of conventions, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/detail/diagnose_conventions.hpp>
#include <fusion/detail/diagnosis_words.hpp>
