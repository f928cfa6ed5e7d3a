"""The report to hand in: one document as a page, a Word file, a PDF or a workbook."""
